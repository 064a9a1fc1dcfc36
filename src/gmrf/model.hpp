// The Gaussian field that the seabed is modelled as, and what its grid cannot represent of it.
// docs/gmrf.md has the formulas.
#pragma once

#include <array>

namespace gmrf {

// Matérn, nu = 1, on a grid (Lindgren, Rue, Lindström 2011).
struct Model {
  // h: distance between neighbouring nodes.
  double spacing_m = 2.0;
  // l: at this distance the correlation has fallen to about 0.14.
  double lengthscale_m = 25.0;
  // o: variance of the seabed about its mean.
  double outputscale_m2 = 1.0;
  // sigma^2: of a beam about the seabed.
  double noise_variance_m2 = 0.01;

  // Throws std::invalid_argument that names what is not finite or not above 0.
  void check() const;

  // k(r)/o = s K1(s), s = sqrt(8) r / l.
  double correlation(double distance_m) const;
  // kappa h: without a unit.
  double kappa() const;
  // tau^2: Q = tau^2 (kappa^2 I - Laplacian)^2 in node units has the variance o.
  double precisionScale() const;
};

// Variance of the continuous field about its bilinear interpolation from the nodes around.
class DiscretisationVariance {
 public:
  explicit DiscretisationVariance(const Model& model);

  // At a place in a cell, both coordinates in [0, 1].
  double at(double fx, double fy) const;
  // Over a cell.
  double mean() const { return mean_; }

 private:
  static constexpr int kSteps = 8;

  std::array<std::array<double, kSteps + 1>, kSteps + 1> table_{};
  double mean_ = 0.0;
};

}  // namespace gmrf
