// Poses in the plane as rigid motions.
#pragma once

#include <cmath>

#include "rbpf_core/motion_model.hpp"
#include "rbpf_core/types.hpp"

namespace rbpf_core {

// First a, then b as seen from a: T_world_b = T_world_a T_a_b.
inline Pose2 compose(const Pose2& a, const Pose2& b) {
  const double c = std::cos(a.yaw_rad);
  const double s = std::sin(a.yaw_rad);
  return {a.x_m + c * b.x_m - s * b.y_m, a.y_m + s * b.x_m + c * b.y_m,
          wrapAngle(a.yaw_rad + b.yaw_rad)};
}

// compose(inverse(a), a) is the identity.
inline Pose2 inverse(const Pose2& a) {
  const double c = std::cos(a.yaw_rad);
  const double s = std::sin(a.yaw_rad);
  return {-c * a.x_m - s * a.y_m, s * a.x_m - c * a.y_m, wrapAngle(-a.yaw_rad)};
}

// b as seen from a.
inline Pose2 relative(const Pose2& a, const Pose2& b) { return compose(inverse(a), b); }

}  // namespace rbpf_core
