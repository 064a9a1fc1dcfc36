#include "gmrf/model.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "gmrf/cell.hpp"

namespace gmrf {

namespace {

void expectPositive(const char* name, double value) {
  if (std::isfinite(value) && value > 0.0) return;
  throw std::invalid_argument(std::string(name) + " is " + std::to_string(value) +
                              "; expected a finite number above 0");
}

}  // namespace

void Model::check() const {
  expectPositive("spacing_m", spacing_m);
  expectPositive("lengthscale_m", lengthscale_m);
  expectPositive("outputscale_m2", outputscale_m2);
  expectPositive("noise_variance_m2", noise_variance_m2);
}

double Model::correlation(double distance_m) const {
  const double s = std::sqrt(8.0) * distance_m / lengthscale_m;
  if (s < 1e-9) return 1.0;
  return s > 600.0 ? 0.0 : s * std::cyl_bessel_k(1.0, s);
}

double Model::kappa() const { return std::sqrt(8.0) * spacing_m / lengthscale_m; }

double Model::precisionScale() const {
  return 1.0 / (4.0 * M_PI * kappa() * kappa() * outputscale_m2);
}

// k(0) - 2 sum_a phi_a k(p - n_a) + sum_ab phi_a phi_b k(n_a - n_b), over the cell's four corners.
DiscretisationVariance::DiscretisationVariance(const Model& model) {
  const double h = model.spacing_m;
  const double side = model.correlation(h);
  const double diagonal = model.correlation(h * M_SQRT2);
  for (int i = 0; i <= kSteps; ++i) {
    for (int j = 0; j <= kSteps; ++j) {
      const double fx = static_cast<double>(i) / kSteps;
      const double fy = static_cast<double>(j) / kSteps;
      const CornerWeights phi = cornerWeights(fx, fy);
      double to_corners = 0.0;
      double between_corners = 0.0;
      for (int a = 0; a < 4; ++a) {
        const double dx = fx - (a >> 1);
        const double dy = fy - (a & 1);
        to_corners += phi[a] * model.correlation(h * std::hypot(dx, dy));
        for (int b = 0; b < 4; ++b) {
          const int steps = ((a ^ b) & 1) + ((a ^ b) >> 1);
          between_corners += phi[a] * phi[b] * (steps == 0 ? 1.0 : steps == 1 ? side : diagonal);
        }
      }
      table_[i][j] =
          std::max(0.0, model.outputscale_m2 * (1.0 - 2.0 * to_corners + between_corners));
    }
  }
  // Trapezium rule.
  double sum = 0.0;
  for (int i = 0; i <= kSteps; ++i) {
    for (int j = 0; j <= kSteps; ++j) {
      const bool edge_x = i == 0 || i == kSteps;
      const bool edge_y = j == 0 || j == kSteps;
      sum += table_[i][j] * (edge_x ? 0.5 : 1.0) * (edge_y ? 0.5 : 1.0);
    }
  }
  mean_ = sum / (kSteps * kSteps);
}

double DiscretisationVariance::at(double fx, double fy) const {
  const auto place = [](double f) {
    const double steps = std::clamp(f, 0.0, 1.0) * kSteps;
    const int whole = std::min(static_cast<int>(steps), kSteps - 1);
    return std::pair<int, double>(whole, steps - whole);
  };
  const auto [i, u] = place(fx);
  const auto [j, v] = place(fy);
  const CornerWeights phi = cornerWeights(u, v);
  return phi[0] * table_[i][j] + phi[1] * table_[i][j + 1] + phi[2] * table_[i + 1][j] +
         phi[3] * table_[i + 1][j + 1];
}

}  // namespace gmrf
