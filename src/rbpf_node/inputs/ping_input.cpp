#include "rbpf_node/inputs/ping_input.hpp"

#include "rbpf_core/refusal.hpp"
#include "rbpf_node/frames.hpp"

namespace rbpf_node {

PingInput pingOf(const std_msgs::Header& header) {
  PingInput input;
  input.stamp = header.stamp;
  input.frame = withoutSlash(header.frame_id);
  if (input.frame.empty()) {
    throw rbpf_core::Refusal(
        rbpf_core::Reason::kWrongFrame,
        "ping's header.frame_id is '" + header.frame_id + "', expected the sensor's frame");
  }
  return input;
}

rbpf_core::Ping toPing(const PingInput& input, const Eigen::Isometry3d& T_base_sensor) {
  rbpf_core::Ping ping;
  ping.stamp_s = input.stamp.toSec();
  ping.sensor_m = T_base_sensor.translation().cast<float>();
  ping.beams_m.resize(3, input.beams_m.cols());
  const Eigen::Isometry3f T = T_base_sensor.cast<float>();
  for (Eigen::Index i = 0; i < ping.beams_m.cols(); ++i) {
    ping.beams_m.col(i) = T * Eigen::Vector3f(input.beams_m.col(i));
  }
  return ping;
}

}  // namespace rbpf_node
