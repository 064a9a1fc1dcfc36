// Middle and spread of numbers of which some may be anything.
#pragma once

#include <Eigen/Core>
#include <algorithm>

namespace gmrf {

// The upper one of the two in the middle; there must be a number.
inline double median(Eigen::VectorXd values) {
  const auto middle = values.data() + values.size() / 2;
  std::nth_element(values.data(), middle, values.data() + values.size());
  return *middle;
}

// Standard deviation about 0, by the median absolute deviation of a normal distribution.
inline double robustStd(const Eigen::VectorXd& residuals) {
  constexpr double kStdOverMad = 1.4826;
  return kStdOverMad * median(residuals.cwiseAbs());
}

}  // namespace gmrf
