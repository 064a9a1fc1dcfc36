// Which mount each sensor's pings are placed with.
#pragma once

#include <Eigen/Geometry>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "rbpf_core/finding.hpp"
#include "rbpf_core/input_gate.hpp"
#include "rbpf_core/refusal.hpp"

namespace rbpf_core {

// The first plausible mount of a sensor stays in use for the whole survey: mounts are static, and a
// map of two of them would be none. To be called from one thread at a time.
class MountGate {
 public:
  explicit MountGate(const PlausibilityParams& params) : params_(params) {}

  // What tf says now of where a frame is; what is wrong with it as long as no plausible one has
  // come, nothing from then on.
  std::optional<Refusal> check(const std::string& frame, const Eigen::Isometry3d& T_base_sensor);

  // Only for frames of which check() has said nothing bad.
  const Eigen::Isometry3d& inUse(const std::string& frame) const { return in_use_.at(frame); }

  std::vector<std::string> framesInUse() const;

  // Mounts that have changed since they came into use, the first change of each.
  std::vector<Finding> findings() const;

 private:
  void noteChange(const std::string& frame, const Eigen::Isometry3d& now);

  const PlausibilityParams params_;
  std::map<std::string, Eigen::Isometry3d> in_use_;
  std::map<std::string, Finding> changed_;
};

}  // namespace rbpf_core
