#include "rbpf_core/mount_gate.hpp"

#include <cmath>

#include "rbpf_core/decimal.hpp"

namespace rbpf_core {

namespace {

std::string placeOf(const Eigen::Isometry3d& T) {
  const Eigen::Vector3d p = T.translation();
  return "(" + decimal(p.x(), 3) + ", " + decimal(p.y(), 3) + ", " + decimal(p.z(), 3) + ") m";
}

}  // namespace

std::optional<Refusal> MountGate::check(const std::string& frame,
                                        const Eigen::Isometry3d& T_base_sensor) {
  if (in_use_.count(frame) != 0) {
    noteChange(frame, T_base_sensor);
    return std::nullopt;
  }
  // false for NaN
  if (!(T_base_sensor.translation().norm() <= params_.max_lever_arm_m)) {
    return Refusal(Reason::kImplausibleMount,
                   "the mount of '" + frame + "' is at " + placeOf(T_base_sensor) +
                       " of the base, expected within " + decimal(params_.max_lever_arm_m, 1) +
                       " m. Is it in millimetres, or is the frame another vehicle's?");
  }
  // messages carry rounded quaternions
  if (!T_base_sensor.linear().isUnitary(0.01)) {
    return Refusal(Reason::kImplausibleMount, "the mount of '" + frame +
                                                  "' is no rotation, expected a quaternion of "
                                                  "norm 1");
  }
  in_use_.emplace(frame, T_base_sensor);
  return std::nullopt;
}

void MountGate::noteChange(const std::string& frame, const Eigen::Isometry3d& now) {
  const Eigen::Isometry3d& first = in_use_.at(frame);
  const double shift_m = (now.translation() - first.translation()).norm();
  const double turn_rad =
      std::abs(Eigen::AngleAxisd(first.linear().transpose() * now.linear()).angle());
  if (shift_m <= params_.max_mount_shift_m && turn_rad <= params_.max_mount_turn_rad) return;
  changed_.emplace(
      frame,
      Finding{"mount_changed", Severity::kWarning,
              "the mount of '" + frame + "' was at " + placeOf(first) + " and is now at " +
                  placeOf(now) + ", turned by " + decimal(turn_rad, 3) +
                  " rad; the first stays in use. Do two nodes publish it, or does it move?"});
}

std::vector<std::string> MountGate::framesInUse() const {
  std::vector<std::string> frames;
  for (const auto& [frame, T_base_sensor] : in_use_) frames.push_back(frame);
  return frames;
}

std::vector<Finding> MountGate::findings() const {
  std::vector<Finding> findings;
  for (const auto& [frame, finding] : changed_) findings.push_back(finding);
  return findings;
}

}  // namespace rbpf_core
