#include "rbpf_core/past_correction.hpp"

#include <cmath>
#include <stdexcept>
#include <string>

namespace rbpf_core {

namespace {

void expectFinite(double a, double b, double c, const std::string& what) {
  if (std::isfinite(a) && std::isfinite(b) && std::isfinite(c)) return;
  throw std::invalid_argument("correction of the past: " + what + " is (" + std::to_string(a) +
                              ", " + std::to_string(b) + ", " + std::to_string(c) +
                              "), expected finite numbers");
}

void expectFinite(const Pose2& motion, const std::string& what) {
  expectFinite(motion.x_m, motion.y_m, motion.yaw_rad, what);
}

}  // namespace

void expectFinite(const PastCorrection& correction) {
  for (std::size_t i = 0; i < correction.of_ping.size(); ++i) {
    expectFinite(correction.of_ping[i], "the motion of ping " + std::to_string(i));
  }
  expectFinite(correction.of_rest, "the motion of the rest");
  const MotionBias& bias = correction.bias;
  expectFinite(bias.surge_mps, bias.sway_mps, bias.yaw_radps, "the bias");
}

}  // namespace rbpf_core
