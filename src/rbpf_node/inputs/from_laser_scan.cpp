#include "rbpf_node/inputs/from_laser_scan.hpp"

#include <cmath>
#include <string>

#include "rbpf_core/refusal.hpp"

namespace rbpf_node {

namespace {

void expectFinite(const std::string& name, float value) {
  if (std::isfinite(value)) return;
  throw rbpf_core::Refusal(
      rbpf_core::Reason::kNotFinite,
      "scan's " + name + " is " + std::to_string(value) + ", expected a finite number");
}

void check(const sensor_msgs::LaserScan& message) {
  expectFinite("angle_min", message.angle_min);
  expectFinite("angle_increment", message.angle_increment);
  if (message.angle_increment == 0.0F && message.ranges.size() > 1) {
    throw rbpf_core::Refusal(rbpf_core::Reason::kMalformed,
                             "scan's angle_increment is 0, expected another angle for each of " +
                                 std::to_string(message.ranges.size()) + " ranges");
  }
  // range_max may be infinite
  if (!(message.range_min >= 0.0F && message.range_max > message.range_min)) {
    throw rbpf_core::Refusal(
        rbpf_core::Reason::kMalformed,
        "scan's range_min .. range_max is " + std::to_string(message.range_min) + " .. " +
            std::to_string(message.range_max) + ", expected 0 or more .. more than that");
  }
}

}  // namespace

PingInput fromLaserScan(const sensor_msgs::LaserScan& message) {
  check(message);
  PingInput input = pingOf(message.header);
  input.beams_m.resize(3, static_cast<Eigen::Index>(message.ranges.size()));
  Eigen::Index beams = 0;
  for (std::size_t i = 0; i < message.ranges.size(); ++i) {
    const double range_m = message.ranges[i];
    // false for NaN as well; infinite: nothing came back (REP 117)
    const bool is_beam = range_m >= message.range_min && range_m <= message.range_max;
    if (!is_beam || std::isinf(range_m)) continue;
    const double angle_rad =
        message.angle_min + static_cast<double>(i) * static_cast<double>(message.angle_increment);
    input.beams_m.col(beams++) << static_cast<float>(range_m * std::cos(angle_rad)),
        static_cast<float>(range_m * std::sin(angle_rad)), 0.0F;
  }
  input.beams_m.conservativeResize(Eigen::NoChange, beams);
  return input;
}

}  // namespace rbpf_node
