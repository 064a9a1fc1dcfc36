#include "rbpf_core/smoothing/local_map.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "gmrf/robust_spread.hpp"
#include "gmrf/window.hpp"
#include "rbpf_core/smoothing/seabed_model.hpp"

namespace rbpf_core::smoothing {

namespace {

// The finest grid, and how many beams there are to a cell of any other.
constexpr double kFinest_m = 1.0;
constexpr double kBeamsInCell = 8.0;
// The field: over what distance depths are alike.
constexpr double kLengthscale_m = 25.0;
// A node counts as seen if beams of so much weight, in beams, are around it.
constexpr float kSeen = 0.4F;
constexpr int kSolves = 3;
// Nodes around the beams that the field has in addition.
constexpr int kMargin = 2;

// From the number of beams in cells of 1 m: the swath has holes and bent edges.
double spacingFor(const Beams& beams_m) {
  std::vector<std::pair<int, int>> cells;
  for (Eigen::Index b = 0; b < beams_m.cols(); ++b) {
    cells.emplace_back(std::floor(beams_m(0, b)), std::floor(beams_m(1, b)));
  }
  std::sort(cells.begin(), cells.end());
  const auto touched = std::unique(cells.begin(), cells.end()) - cells.begin();
  const double density = static_cast<double>(beams_m.cols()) / static_cast<double>(touched);
  if (density > 1.5) return std::max(kFinest_m, std::sqrt(kBeamsInCell / density));
  // most beams are alone in their cells: the area is not the cells', but that of what surrounds
  // them
  const Eigen::Array2f extent =
      (beams_m.topRows<2>().rowwise().maxCoeff() - beams_m.topRows<2>().rowwise().minCoeff())
          .array();
  return std::max(kFinest_m, std::sqrt(kBeamsInCell * static_cast<double>(extent.prod()) /
                                       static_cast<double>(beams_m.cols())));
}

}  // namespace

LocalMap::LocalMap(const Beams& beams_m) {
  if (beams_m.cols() == 0) return;
  spacing_m_ = spacingFor(beams_m);
  const Plane plane(beams_m);
  std::vector<gmrf::CellPlace> places;
  Eigen::VectorXd off_m(beams_m.cols());  // the plane
  for (Eigen::Index b = 0; b < beams_m.cols(); ++b) {
    places.push_back(gmrf::cellOf(beams_m(0, b), beams_m(1, b), spacing_m_));
    off_m(b) = beams_m(2, b) - plane.at(beams_m(0, b), beams_m(1, b));
  }
  const gmrf::Window window(places, kMargin);
  gmrf::Model model;
  model.spacing_m = spacing_m_;
  model.lengthscale_m = std::max(kLengthscale_m, 10.0 * spacing_m_);
  model.outputscale_m2 = fieldVariance(places, off_m, model);

  Eigen::VectorXd weights = Eigen::VectorXd::Ones(beams_m.cols());
  noise_std_m_ = kLeastNoise_m;
  Eigen::VectorXd field;
  for (int solve = 0; solve < kSolves; ++solve) {
    gmrf::TiledSums sums;
    for (Eigen::Index b = 0; b < beams_m.cols(); ++b) sums.add(places[b], off_m(b), weights(b));
    gmrf::EnvelopeMatrix precision = priorPrecision(window, model);
    field = addData(window, sums, noise_std_m_ * noise_std_m_, &precision).information;
    precision.factorise();
    precision.solve(&field);
    Eigen::VectorXd residual_m(beams_m.cols());
    for (Eigen::Index b = 0; b < beams_m.cols(); ++b) {
      const auto [i, j] = places[b].cell;
      const gmrf::CornerWeights phi = gmrf::cornerWeights(places[b].fx, places[b].fy);
      const double at =
          phi[0] * field(window.number({i, j})) + phi[1] * field(window.number({i, j + 1})) +
          phi[2] * field(window.number({i + 1, j})) + phi[3] * field(window.number({i + 1, j + 1}));
      residual_m(b) = off_m(b) - at;
    }
    noise_std_m_ = std::max(kLeastNoise_m, gmrf::robustStd(residual_m));
    weights = residual_m.unaryExpr([this](double r) { return robustWeight(r, noise_std_m_); });
  }

  const auto [low, high] = gmrf::boundsOf(places);
  first_i_ = low.i;
  first_j_ = low.j;
  rows_ = high.i - low.i + 2;
  columns_ = high.j - low.j + 2;
  seen_.assign(static_cast<std::size_t>(rows_) * columns_, 0.0F);
  for (const gmrf::CellPlace& place : places) {
    const gmrf::CornerWeights phi = gmrf::cornerWeights(place.fx, place.fy);
    const auto add = [&](std::size_t node, double beams) {
      seen_[node] += static_cast<float>(beams);
    };
    const std::size_t at = static_cast<std::size_t>(place.cell.i - first_i_) * columns_ +
                           static_cast<std::size_t>(place.cell.j - first_j_);
    add(at, phi[0]);
    add(at + 1, phi[1]);
    add(at + columns_, phi[2]);
    add(at + columns_ + 1, phi[3]);
  }
  z_m_.assign(seen_.size(), std::numeric_limits<float>::quiet_NaN());
  for (int i = 0; i < rows_; ++i) {
    for (int j = 0; j < columns_; ++j) {
      const std::size_t at = static_cast<std::size_t>(i) * columns_ + j;
      if (seen_[at] < kSeen) continue;
      const gmrf::NodeIndex node{first_i_ + i, first_j_ + j};
      z_m_[at] = static_cast<float>(plane.at(node.i * spacing_m_, node.j * spacing_m_) +
                                    field(window.number(node)));
    }
  }
}

std::optional<LocalMap::InCell> LocalMap::cellAt(float x_m, float y_m) const {
  const float h = static_cast<float>(spacing_m_);
  const float u = x_m / h - static_cast<float>(first_i_);
  const float v = y_m / h - static_cast<float>(first_j_);
  // false for NaN
  if (!(u >= 0.0F && v >= 0.0F && u < static_cast<float>(rows_ - 1) &&
        v < static_cast<float>(columns_ - 1))) {
    return std::nullopt;
  }
  const int i = static_cast<int>(u);
  const int j = static_cast<int>(v);
  return InCell{i, j, u - static_cast<float>(i), v - static_cast<float>(j)};
}

LocalMap::Look LocalMap::at(float x_m, float y_m) const {
  const std::optional<InCell> cell = cellAt(x_m, y_m);
  if (!cell) return {false, 0.0F, 0.0F, 0.0F};
  const auto [i, j, a, b] = *cell;
  const float h = static_cast<float>(spacing_m_);
  const float z00 = z(i, j), z01 = z(i, j + 1), z10 = z(i + 1, j), z11 = z(i + 1, j + 1);
  const float slope_x = ((1.0F - b) * (z10 - z00) + b * (z11 - z01)) / h;
  const float slope_y = ((1.0F - a) * (z01 - z00) + a * (z11 - z10)) / h;
  const float near = (1.0F - b) * z00 + b * z01;
  const float z_m = near + a * h * slope_x;
  return {!std::isnan(z_m), z_m, slope_x, slope_y};
}

double LocalMap::beamsAt(float x_m, float y_m) const {
  const std::optional<InCell> cell = cellAt(x_m, y_m);
  if (!cell) return 0.0;
  const std::size_t at = static_cast<std::size_t>(cell->i) * columns_ + cell->j;
  return std::min({seen_[at], seen_[at + 1], seen_[at + columns_], seen_[at + columns_ + 1]});
}

}  // namespace rbpf_core::smoothing
