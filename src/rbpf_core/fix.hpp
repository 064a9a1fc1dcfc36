// Absolute positions, as of GPS at the surface or of USBL from a ship: late, and with outliers.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "rbpf_core/types.hpp"

namespace rbpf_core {

// Yaw of base_link in map.
struct Heading {
  double yaw_rad = 0.0;
  double variance_rad2 = 0.0;
};

struct Fix {
  double stamp_s = 0.0;
  // Of base_link in map.
  Eigen::Vector2d position_m = Eigen::Vector2d::Zero();
  Eigen::Matrix2d covariance_m2 = Eigen::Matrix2d::Identity();
  // With one it is a pose that an operator gives: it is believed, particles are drawn anew about
  // it, and before the first ping it is the start.
  std::optional<Heading> heading = std::nullopt;
};

// One that the filter has taken, and where dead reckoning was at its stamp.
struct FixRecord {
  Fix fix;
  Pose2 dead_reckoning;
};

// Defaults are those of config/default.yaml.
struct FixParams {
  // Further from the estimate than so many standard deviations of both, a fix contradicts it.
  double max_sigmas = 5.0;
  // The odometry may drift by so much more than the estimate's covariance says, since the start or
  // the last fix that is in the estimate; m/s.
  double drift_mps = 0.02;
  // Later than this, s, a fix is refused.
  double max_late_s = 10.0;
  // One that is less certain than this, m, says nothing.
  double max_std_m = 1000.0;
};

// [J] log likelihoods of a fix at the particles' poses, up to a constant: Student-t, so that an
// outlier says little.
Eigen::ArrayXd fixLikelihood(const Fix& fix, const std::vector<Pose2>& poses);

// How far off a position is, in standard deviations of this covariance.
double sigmasOf(const Eigen::Vector2d& off_m, const Eigen::Matrix2d& covariance_m2);

}  // namespace rbpf_core
