// What the statistical tests share. Seeds are fixed, so that a test that passes once always passes;
// bounds of five standard errors would refuse a sound one in a million times.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstddef>
#include <vector>

namespace rbpf_core {

constexpr double kStandardErrors = 5.0;

// Chi-square of counts that should be alike.
inline double chiSquare(const std::vector<std::size_t>& counts) {
  double draws = 0.0;
  for (const std::size_t count : counts) draws += static_cast<double>(count);
  const double expected = draws / static_cast<double>(counts.size());
  double sum = 0.0;
  for (const std::size_t count : counts) {
    const double difference = static_cast<double>(count) - expected;
    sum += difference * difference / expected;
  }
  return sum;
}

// With k - 1 degrees of freedom chi-square has the mean k - 1 and the variance 2 (k - 1).
inline double chiSquareLimit(std::size_t bins) {
  const double freedom = static_cast<double>(bins) - 1.0;
  return freedom + kStandardErrors * std::sqrt(2.0 * freedom);
}

// Sample mean and covariance of [n, d] samples, one row a sample.
struct Moments {
  Eigen::RowVectorXd mean;
  Eigen::MatrixXd covariance;
};

inline Moments momentsOf(const Eigen::MatrixXd& samples) {
  const Eigen::RowVectorXd mean = samples.colwise().mean();
  const Eigen::MatrixXd centred = samples.rowwise() - mean;
  return {mean, centred.transpose() * centred / static_cast<double>(samples.rows() - 1)};
}

// Standard error of a Gaussian sample's covariance entry: var(s_ab) = (C_aa C_bb + C_ab^2) / (n -
// 1).
inline double covarianceError(const Eigen::MatrixXd& covariance, Eigen::Index a, Eigen::Index b,
                              Eigen::Index samples) {
  return std::sqrt((covariance(a, a) * covariance(b, b) + covariance(a, b) * covariance(a, b)) /
                   static_cast<double>(samples - 1));
}

}  // namespace rbpf_core
