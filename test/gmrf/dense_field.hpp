// The field written out with dense matrices, straight from its definition, and seabeds drawn from
// it: what the library is held against.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <random>
#include <utility>
#include <vector>

#include "gmrf/map.hpp"
#include "gmrf/window.hpp"

namespace gmrf {

inline double kappaOf(const Model& model) {
  return std::sqrt(8.0) * model.spacing_m / model.lengthscale_m;
}

inline double tauOf(const Model& model) {
  return 1.0 / (kappaOf(model) * std::sqrt(4.0 * M_PI * model.outputscale_m2));
}

inline std::vector<CellPlace> placesOf(const Points& points, double spacing_m) {
  std::vector<CellPlace> places;
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    places.push_back(cellOf(points(0, i), points(1, i), spacing_m));
  }
  return places;
}

inline std::vector<NodeIndex> nodesOf(const Window& window) {
  std::vector<NodeIndex> nodes;
  for (int n = 0; n < window.nodes(); ++n) nodes.push_back(window.node(n));
  return nodes;
}

// Q = tau^2 (kappa^2 I - Laplacian)^2; a neighbour that is not among the nodes does not count.
inline Eigen::MatrixXd densePrecision(const std::vector<NodeIndex>& nodes, const Model& model) {
  const auto n = static_cast<Eigen::Index>(nodes.size());
  Eigen::MatrixXd K = Eigen::MatrixXd::Identity(n, n) * kappaOf(model) * kappaOf(model);
  for (Eigen::Index a = 0; a < n; ++a) {
    for (Eigen::Index b = 0; b < n; ++b) {
      const NodeIndex& p = nodes[static_cast<std::size_t>(a)];
      const NodeIndex& q = nodes[static_cast<std::size_t>(b)];
      if (std::abs(p.i - q.i) + std::abs(p.j - q.j) != 1) continue;
      K(a, a) += 1.0;
      K(a, b) -= 1.0;
    }
  }
  return tauOf(model) * tauOf(model) * K * K;
}

// Bilinear weights [points, nodes] as products of hat functions.
inline Eigen::MatrixXd denseInterpolation(const std::vector<NodeIndex>& nodes, const Points& points,
                                          double spacing_m) {
  Eigen::MatrixXd phi(points.cols(), static_cast<Eigen::Index>(nodes.size()));
  for (Eigen::Index a = 0; a < phi.cols(); ++a) {
    const NodeIndex& node = nodes[static_cast<std::size_t>(a)];
    for (Eigen::Index p = 0; p < phi.rows(); ++p) {
      phi(p, a) = std::max(0.0, 1.0 - std::abs(points(0, p) / spacing_m - node.i)) *
                  std::max(0.0, 1.0 - std::abs(points(1, p) / spacing_m - node.j));
    }
  }
  return phi;
}

// Mean and variance of the nodes' interpolation at points; what lies between the nodes is not in
// the variance.
inline Prediction densePrediction(const std::vector<NodeIndex>& nodes, const Beams& beams,
                                  const Eigen::VectorXd& weights, double reference_m,
                                  const Points& points, const FieldModel& field) {
  const double h = field.model().spacing_m;
  const Eigen::MatrixXd phi = denseInterpolation(nodes, beams.topRows<2>(), h);
  const Eigen::VectorXd precisions = weights / field.beamVariance();
  const Eigen::MatrixXd A =
      densePrecision(nodes, field.model()) + phi.transpose() * precisions.asDiagonal() * phi;
  const Eigen::VectorXd depths = beams.row(2).transpose().array() - reference_m;
  const Eigen::LLT<Eigen::MatrixXd> factor(A);
  const Eigen::VectorXd x = factor.solve(phi.transpose() * precisions.cwiseProduct(depths));
  const Eigen::MatrixXd at = denseInterpolation(nodes, points, h);
  return {(at * x).array() + reference_m, (at * factor.solve(at.transpose())).diagonal()};
}

// A seabed drawn from the model on a grid finer than the model's, from (0, 0) on.
//
// On a rectangle with Neumann edges the Laplacian's eigenvectors are cosines: white noise is
// divided by their eigenvalues.
class DrawnSeabed {
 public:
  static constexpr int kFiner = 4;

  DrawnSeabed(double length_m, double width_m, Model model, double mean_m, std::uint32_t seed) {
    model.spacing_m /= kFiner;
    spacing_m_ = model.spacing_m;
    const auto rows = static_cast<Eigen::Index>(length_m / spacing_m_) + 2;
    const auto columns = static_cast<Eigen::Index>(width_m / spacing_m_) + 2;
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    const auto [U, u] = cosines(rows);
    const auto [V, v] = cosines(columns);
    Eigen::MatrixXd noise(rows, columns);
    for (Eigen::Index i = 0; i < rows; ++i) {
      for (Eigen::Index j = 0; j < columns; ++j) {
        const double kappa2 = kappaOf(model) * kappaOf(model);
        noise(i, j) = normal(random) / (tauOf(model) * (kappa2 + u(i) + v(j)));
      }
    }
    z_m_ = (U * noise * V.transpose()).array() + mean_m;
  }

  double at(double x_m, double y_m) const {
    const CellPlace place = cellOf(x_m, y_m, spacing_m_);
    const CornerWeights phi = cornerWeights(place.fx, place.fy);
    const auto [i, j] = place.cell;
    return phi[0] * z_m_(i, j) + phi[1] * z_m_(i, j + 1) + phi[2] * z_m_(i + 1, j) +
           phi[3] * z_m_(i + 1, j + 1);
  }

 private:
  // Eigenvectors, as columns, and eigenvalues of minus the Laplacian of n nodes in a row.
  static std::pair<Eigen::MatrixXd, Eigen::VectorXd> cosines(Eigen::Index n) {
    Eigen::MatrixXd vectors(n, n);
    Eigen::VectorXd values(n);
    for (Eigen::Index k = 0; k < n; ++k) {
      const double step = M_PI * static_cast<double>(k) / static_cast<double>(n);
      for (Eigen::Index i = 0; i < n; ++i) {
        vectors(i, k) = std::cos(step * (static_cast<double>(i) + 0.5));
      }
      vectors.col(k).normalize();
      values(k) = 2.0 - 2.0 * std::cos(step);
    }
    return {vectors, values};
  }

  double spacing_m_;
  Eigen::MatrixXd z_m_;
};

// The middles of rows x columns cells from node (0, 0) on: a window over them is a rectangle.
inline Points cellsOf(int rows, int columns, double spacing_m) {
  Points points(2, rows * columns);
  for (int k = 0; k < points.cols(); ++k) points.col(k) << 0.5 + k / columns, 0.5 + k % columns;
  return spacing_m * points;
}

// Places drawn evenly from [0, length_m) x [0, width_m).
inline Points evenPoints(Eigen::Index n, double length_m, double width_m, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  Points points(2, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const double x_m = length_m * unit(random);
    points.col(i) << x_m, width_m * unit(random);
  }
  return points;
}

// Beams at given places upon a seabed, a function of x and y, with normal noise.
template <typename Seabed>
Beams beamsOn(const Seabed& seabed, const Points& places, double noise_std_m, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  Beams beams(3, places.cols());
  beams.topRows<2>() = places;
  for (Eigen::Index i = 0; i < places.cols(); ++i) {
    beams(2, i) = seabed(places(0, i), places(1, i)) + noise_std_m * normal(random);
  }
  return beams;
}

inline Eigen::VectorXd fullWeights(const Beams& beams) {
  return Eigen::VectorXd::Ones(beams.cols());
}

}  // namespace gmrf
