#include "rbpf_core/fix.hpp"

#include <Eigen/Cholesky>
#include <cmath>

namespace rbpf_core {

namespace {

// Degrees of freedom: as of the beams.
constexpr double kDof = 4.0;

}  // namespace

double sigmasOf(const Eigen::Vector2d& off_m, const Eigen::Matrix2d& covariance_m2) {
  return std::sqrt(off_m.dot(covariance_m2.llt().solve(off_m)));
}

// log p = -(nu + 2) / 2 log(1 + d^2 / nu), in two dimensions
Eigen::ArrayXd fixLikelihood(const Fix& fix, const std::vector<Pose2>& poses) {
  Eigen::ArrayXd log_likelihood(static_cast<Eigen::Index>(poses.size()));
  for (std::size_t j = 0; j < poses.size(); ++j) {
    const Eigen::Vector2d off_m = fix.position_m - Eigen::Vector2d(poses[j].x_m, poses[j].y_m);
    const double d = sigmasOf(off_m, fix.covariance_m2);
    log_likelihood(static_cast<Eigen::Index>(j)) = -0.5 * (kDof + 2.0) * std::log1p(d * d / kDof);
  }
  return log_likelihood;
}

}  // namespace rbpf_core
