#include "rbpf_core/known_error.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace rbpf_core {

Eigen::Matrix3d KnownError::covarianceAt(double later_s, const Pose2& there,
                                         const MotionNoise& noise) const {
  const double dx = there.x_m - pose.x_m;
  const double dy = there.y_m - pose.y_m;
  const double duration_s = std::max(later_s - stamp_s, 0.0);
  Eigen::Matrix3d J = Eigen::Matrix3d::Identity();
  J(0, 2) = -dy;
  J(1, 2) = dx;
  const double position_std_m = std::max(noise.surge_std_m, noise.sway_std_m);
  const Eigen::Vector3d per_root_s(position_std_m, position_std_m, noise.yaw_std_rad);
  Eigen::Matrix3d grown = J * covariance * J.transpose();
  grown.diagonal() += duration_s * per_root_s.cwiseAbs2();
  // the heading has wandered on the way there, a third of it as seen from its end
  const Eigen::Vector2d aside(-dy, dx);
  grown.topLeftCorner<2, 2>() +=
      duration_s / 3.0 * noise.yaw_std_rad * noise.yaw_std_rad * aside * aside.transpose();
  return grown;
}

Eigen::Matrix3d largerOf(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b) {
  // Lengths for angles: a radian counts as so many metres.
  constexpr double kArm_m = 20.0;
  const Eigen::Vector3d scale(1.0, 1.0, kArm_m);
  const Eigen::Matrix3d difference = scale.asDiagonal() * (b - a) * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(difference);
  const Eigen::Matrix3d V = scale.cwiseInverse().asDiagonal() * eigen.eigenvectors();
  return a + V * eigen.eigenvalues().cwiseMax(0.0).asDiagonal() * V.transpose();
}

}  // namespace rbpf_core
