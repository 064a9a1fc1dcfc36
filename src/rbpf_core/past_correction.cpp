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

// Of the pings between two that are told.
Pose2 motionBetween(const PingMotion& before, const PingMotion& after, std::uint64_t ping) {
  return interpolate(
      before.motion, after.motion,
      static_cast<double>(ping - before.ping) / static_cast<double>(after.ping - before.ping));
}

// From the last one that is told up to `last`. By halves: the time that it takes is that of a sort,
// whatever the motions are.
void tell(std::size_t last, const std::vector<Pose2>& motions, const std::vector<Pose2>& poses,
          const MotionTolerance& tolerance, std::vector<PingMotion>* told) {
  const PingMotion before = told->back();
  const PingMotion after{last, motions[last]};
  for (std::size_t i = before.ping + 1; i < last; ++i) {
    const Pose2 made = move(motionBetween(before, after, i), poses[i]);
    if (tolerance.holds(made, move(motions[i], poses[i]))) continue;
    tell(before.ping + (last - before.ping) / 2, motions, poses, tolerance, told);
    tell(last, motions, poses, tolerance, told);
    return;
  }
  told->push_back(after);
}

}  // namespace

void expectSound(const PastCorrection& correction) {
  const std::vector<PingMotion>& told = correction.of_pings;
  for (std::size_t i = 0; i < told.size(); ++i) {
    const std::string ping = "ping " + std::to_string(told[i].ping);
    expectFinite(told[i].motion, "the motion of " + ping);
    if (i == 0 ? told[i].ping == 0 : told[i].ping > told[i - 1].ping) continue;
    throw std::invalid_argument(
        "correction of the past: a motion of " + ping + ", expected " +
        (i == 0 ? "ping 0 first" : "one after ping " + std::to_string(told[i - 1].ping)));
  }
  expectFinite(correction.of_rest, "the motion of the rest");
  const MotionBias& bias = correction.bias;
  expectFinite(bias.surge_mps, bias.sway_mps, bias.yaw_radps, "the bias");
  expectFinite(bias.current_x_mps, bias.current_y_mps, 0.0, "the current");
}

std::vector<Pose2> motionOfEach(const std::vector<PingMotion>& told) {
  std::vector<Pose2> motions;
  for (std::size_t i = 0; i < told.size(); ++i) {
    for (std::uint64_t ping = motions.size(); ping < told[i].ping; ++ping) {
      motions.push_back(motionBetween(told[i - 1], told[i], ping));
    }
    motions.push_back(told[i].motion);
  }
  return motions;
}

bool MotionTolerance::holds(const Pose2& a, const Pose2& b) const {
  return std::hypot(a.x_m - b.x_m, a.y_m - b.y_m) <= position_m &&
         std::abs(wrapAngle(a.yaw_rad - b.yaw_rad)) <= yaw_rad;
}

std::vector<PingMotion> thinned(const std::vector<Pose2>& motions, const std::vector<Pose2>& poses,
                                const MotionTolerance& tolerance) {
  if (motions.empty()) return {};
  std::vector<PingMotion> told{{0, motions[0]}};
  if (motions.size() > 1) tell(motions.size() - 1, motions, poses, tolerance, &told);
  return told;
}

}  // namespace rbpf_core
