#include "rbpf_core/ping_filter.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "rbpf_core/motion_model.hpp"

namespace rbpf_core {

namespace {

// A perfectly flat ping must not make every centimetre of noise an outlier.
constexpr float kSmallestDeviation_m = 0.05F;

float median(std::vector<float> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  if (values.size() % 2 == 1) return *middle;
  return 0.5F * (*middle + *std::max_element(values.begin(), middle));
}

// Depths of the beams around beam i, itself included; cut off at the swath's ends.
std::vector<float> depthsAround(const Beams& beams, Eigen::Index i, Eigen::Index reach) {
  const Eigen::Index first = std::max<Eigen::Index>(0, i - reach);
  const Eigen::Index last = std::min(beams.cols() - 1, i + reach);
  std::vector<float> depths;
  for (Eigen::Index k = first; k <= last; ++k) depths.push_back(beams(2, k));
  return depths;
}

// What pairs of neighbours, each on its own, say of beam i's depth: the middle between one on
// either side or, at the swath's ends, the continuation of two on one side.
std::vector<float> depthsByPairs(const Beams& beams, Eigen::Index i, Eigen::Index reach) {
  const Eigen::Index last = beams.cols() - 1;
  std::vector<float> depths;
  for (Eigen::Index k = 1; k <= reach; ++k) {
    if (i - k >= 0 && i + k <= last) {
      depths.push_back(0.5F * (beams(2, i - k) + beams(2, i + k)));
    } else if (i + 2 * k <= last) {
      depths.push_back(2.0F * beams(2, i + k) - beams(2, i + 2 * k));
    } else if (i - 2 * k >= 0) {
      depths.push_back(2.0F * beams(2, i - k) - beams(2, i - 2 * k));
    }
  }
  return depths;
}

using Neighbours = std::vector<float> (*)(const Beams&, Eigen::Index, Eigen::Index);

// Which beams lie too far from the median of what their neighbours say, in robust standard
// deviations of all the ping's distances.
std::vector<bool> farFromMedian(const Beams& beams, Neighbours neighbours,
                                const PingFilterParams& params) {
  std::vector<float> distance;
  for (Eigen::Index i = 0; i < beams.cols(); ++i) {
    const float expected = median(neighbours(beams, i, params.outlier_window / 2));
    distance.push_back(std::abs(beams(2, i) - expected));
  }
  // 1.4826: from the median absolute deviation to a Gaussian's standard deviation
  const float deviation = std::max(kSmallestDeviation_m, 1.4826F * median(distance));
  const float limit = static_cast<float>(params.outlier_threshold) * deviation;
  std::vector<bool> far;
  for (const float d : distance) far.push_back(d > limit);
  return far;
}

Beams select(const Beams& beams, const std::vector<Eigen::Index>& kept) {
  Beams selected(3, static_cast<Eigen::Index>(kept.size()));
  for (std::size_t i = 0; i < kept.size(); ++i) {
    selected.col(static_cast<Eigen::Index>(i)) = beams.col(kept[i]);
  }
  return selected;
}

// An outlier is far from both medians: the running median stays right at a cliff and among spikes
// side by side, the median over pairs on any slope.
Beams withoutOutliers(const Beams& beams, const PingFilterParams& params) {
  if (params.outlier_window < 3 || beams.cols() < params.outlier_window) return beams;
  const std::vector<bool> far_from_running_median = farFromMedian(beams, depthsAround, params);
  const std::vector<bool> far_from_pairs = farFromMedian(beams, depthsByPairs, params);
  std::vector<Eigen::Index> kept;
  for (Eigen::Index i = 0; i < beams.cols(); ++i) {
    const auto k = static_cast<std::size_t>(i);
    if (!(far_from_running_median[k] && far_from_pairs[k])) kept.push_back(i);
  }
  return select(beams, kept);
}

}  // namespace

Beams levelBeams(const Beams& beams_base_m, const Attitude& attitude) {
  const Eigen::Matrix3f rotation =
      levelRotation(attitude.roll_rad, attitude.pitch_rad).cast<float>();
  Beams levelled = rotation * beams_base_m;
  levelled.row(2).array() += static_cast<float>(attitude.z_m);
  return levelled;
}

Ping inBaseLink(const Ping& ping, const Odometry& odometry) {
  const Attitude& attitude = odometry.attitude;
  const Eigen::Matrix3d R_odom_base =
      Eigen::AngleAxisd(odometry.pose.yaw_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix() *
      levelRotation(attitude.roll_rad, attitude.pitch_rad);
  const Eigen::Vector3d base_m(odometry.pose.x_m, odometry.pose.y_m, attitude.z_m);
  Ping own = ping;
  own.in_odometry_frame = false;
  own.beams_m =
      (R_odom_base.transpose() * (ping.beams_m.cast<double>().colwise() - base_m)).cast<float>();
  return own;
}

Beams goodBeams(const Ping& ping, const Attitude& attitude, const PingFilterParams& params) {
  std::vector<Eigen::Index> kept;
  for (Eigen::Index i = 0; i < ping.beams_m.cols(); ++i) {
    const double range_m = (ping.beams_m.col(i) - ping.sensor_m).norm();
    // false for NaN as well
    if (range_m >= params.min_range_m && range_m <= params.max_range_m) kept.push_back(i);
  }
  return withoutOutliers(levelBeams(select(ping.beams_m, kept), attitude), params);
}

}  // namespace rbpf_core
