// How uncertain the vehicle's place in map is, whatever the particles' spread shows: particles that
// agree with each other may be off all alike.
#pragma once

#include <Eigen/Core>
#include <optional>

#include "rbpf_core/motion_model.hpp"
#include "rbpf_core/types.hpp"

namespace rbpf_core {

struct KnownError {
  double stamp_s = 0.0;
  Pose2 pose;
  // Of x, y, yaw in map, at that stamp and pose.
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  // Stamp of the last absolute fix that this agrees with; none: the start alone says where map is.
  std::optional<double> last_fix_s = std::nullopt;

  // At a later stamp and another pose: it has grown by the motion's noise, and an error in yaw has
  // moved what is far away.
  Eigen::Matrix3d covarianceAt(double later_s, const Pose2& there, const MotionNoise& noise) const;
};

// As much as the larger of both in every direction, of x, y and yaw.
Eigen::Matrix3d largerOf(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b);

}  // namespace rbpf_core
