#include "rbpf_core/smoothing/seabed_model.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cstddef>

#include "gmrf/robust_spread.hpp"

namespace rbpf_core::smoothing {

namespace {

constexpr int kFits = 4;
// Of each coefficient of the plane, over a beam's precision: beams on a line do not tell a slope.
constexpr double kRidge = 1e-6;
// Beams of a cell that make a difference: few are hardly better than their noise.
constexpr int kLeastInCell = 3;
// Cells between which depths are compared; nearer ones are alike, and there are more errors.
constexpr std::size_t kLag = 2;
// Pairs of cells without which differences tell nothing.
constexpr int kLeastPairs = 20;
// The least variance of a field, m^2; and the least if it is not known from differences.
constexpr double kLeastVariance_m2 = 2e-4;
constexpr double kLeastSpread_m2 = 0.1;

// Of the depths in a cell.
struct CellSums {
  int n = 0;
  double mean_m = 0.0;
  double squares_m2 = 0.0;  // about the mean

  void add(double depth_m) {
    const double off_m = depth_m - mean_m;
    mean_m += off_m / ++n;
    squares_m2 += off_m * (depth_m - mean_m);
  }
};

}  // namespace

Plane::Plane(const Beams& beams_m)
    : middle_m_(beams_m.topRows<2>().cast<double>().rowwise().mean()),
      coefficients_(gmrf::median(beams_m.row(2).cast<double>()), 0.0, 0.0) {
  Eigen::Matrix3Xd phi = Eigen::Matrix3Xd::Ones(3, beams_m.cols());
  phi.bottomRows<2>() = beams_m.topRows<2>().cast<double>().colwise() - middle_m_;
  const Eigen::VectorXd z_m = beams_m.row(2).cast<double>();
  for (int fit = 0; fit < kFits; ++fit) {
    const Eigen::VectorXd residual_m = z_m - phi.transpose() * coefficients_;
    const double std_m = std::max(kLeastNoise_m, gmrf::robustStd(residual_m));
    const Eigen::VectorXd weights =
        residual_m.unaryExpr([std_m](double r) { return robustWeight(r, std_m); });
    const Eigen::Matrix3Xd weighted = phi * weights.asDiagonal();
    Eigen::Matrix3d normal = weighted * phi.transpose();
    normal.diagonal().array() += kRidge;
    coefficients_ += normal.ldlt().solve(weighted * residual_m);
  }
}

double fieldVariance(const std::vector<gmrf::CellPlace>& places, const Eigen::VectorXd& depth_m,
                     const gmrf::Model& model) {
  const auto [low, high] = gmrf::boundsOf(places);
  const auto columns = static_cast<std::size_t>(high.j - low.j + 1);
  std::vector<CellSums> cells(static_cast<std::size_t>(high.i - low.i + 1) * columns);
  for (std::size_t b = 0; b < places.size(); ++b) {
    const auto [i, j] = places[b].cell;
    cells[static_cast<std::size_t>(i - low.i) * columns + static_cast<std::size_t>(j - low.j)].add(
        depth_m(static_cast<Eigen::Index>(b)));
  }
  double squares_m2 = 0.0;
  int freedom = 0;
  for (const CellSums& cell : cells) {
    if (cell.n == 0) continue;
    squares_m2 += cell.squares_m2;
    freedom += cell.n - 1;
  }
  // Of a beam within its cell: noise, and relief below the grid.
  const double beam_m2 = freedom > 0 ? squares_m2 / freedom : 0.0;

  double difference_m2 = 0.0;
  int pairs = 0;
  const auto compare = [&](const CellSums& cell, const CellSums& other) {
    if (other.n < kLeastInCell) return;
    const double d_m = other.mean_m - cell.mean_m;
    difference_m2 += d_m * d_m - beam_m2 * (1.0 / cell.n + 1.0 / other.n);
    ++pairs;
  };
  for (std::size_t at = 0; at < cells.size(); ++at) {
    if (cells[at].n < kLeastInCell) continue;
    if (at + kLag * columns < cells.size()) compare(cells[at], cells[at + kLag * columns]);
    if (at % columns + kLag < columns) compare(cells[at], cells[at + kLag]);
  }
  if (pairs < kLeastPairs) {
    return std::max(kLeastSpread_m2, depth_m.squaredNorm() / static_cast<double>(depth_m.size()));
  }
  // E[d^2] = 2 o (1 - rho)
  const double apart = 2.0 * (1.0 - model.correlation(kLag * model.spacing_m));
  return std::max(kLeastVariance_m2, difference_m2 / pairs / apart);
}

}  // namespace rbpf_core::smoothing
