#include "rbpf_core/ping_filter.hpp"

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
  return *middle;
}

// Distance of each depth from the median of the window around it; windows are cut at the swath's
// ends.
std::vector<float> distanceFromRunningMedian(const Beams& beams, int window) {
  const Eigen::Index n = beams.cols();
  const Eigen::Index half = window / 2;
  std::vector<float> distance(static_cast<std::size_t>(n));
  for (Eigen::Index i = 0; i < n; ++i) {
    const Eigen::Index reach = std::min({half, i, n - 1 - i});
    std::vector<float> depths;
    for (Eigen::Index k = i - reach; k <= i + reach; ++k) depths.push_back(beams(2, k));
    distance[static_cast<std::size_t>(i)] = std::abs(beams(2, i) - median(std::move(depths)));
  }
  return distance;
}

Beams select(const Beams& beams, const std::vector<Eigen::Index>& kept) {
  Beams selected(3, static_cast<Eigen::Index>(kept.size()));
  for (std::size_t i = 0; i < kept.size(); ++i) {
    selected.col(static_cast<Eigen::Index>(i)) = beams.col(kept[i]);
  }
  return selected;
}

Beams withoutOutliers(const Beams& beams, const PingFilterParams& params) {
  if (params.outlier_window == 0 || beams.cols() < params.outlier_window) return beams;
  const std::vector<float> distance = distanceFromRunningMedian(beams, params.outlier_window);
  // 1.4826: from the median absolute deviation to a Gaussian's standard deviation
  const float deviation = std::max(kSmallestDeviation_m, 1.4826F * median(distance));
  const float limit = static_cast<float>(params.outlier_threshold) * deviation;
  std::vector<Eigen::Index> kept;
  for (Eigen::Index i = 0; i < beams.cols(); ++i) {
    if (distance[static_cast<std::size_t>(i)] <= limit) kept.push_back(i);
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
