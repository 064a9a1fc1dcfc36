// What a small map takes the seabed to be before it looks at it more closely: a plane, and a field
// about it.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "gmrf/cell.hpp"
#include "gmrf/model.hpp"
#include "rbpf_core/types.hpp"

namespace rbpf_core::smoothing {

// Smallest deviation that a beam is believed to have about the seabed, m.
constexpr double kLeastNoise_m = 0.05;

// Of a beam so far off: it is weighted down beyond two deviations.
inline double robustWeight(double residual_m, double std_m) {
  constexpr double kOutlier = 2.0;
  const double off = residual_m / (kOutlier * std_m);
  return 1.0 / (1.0 + off * off);
}

class Plane {
 public:
  // Robust, of [3, n] beams, metres; there is one.
  explicit Plane(const Beams& beams_m);

  double at(double x_m, double y_m) const {
    return coefficients_.dot(Eigen::Vector3d(1.0, x_m - middle_m_.x(), y_m - middle_m_.y()));
  }

 private:
  Eigen::Vector2d middle_m_;
  Eigen::Vector3d coefficients_;  // level, m; slopes by x and y
};

// The outputscale, m^2, of a field of the model's lengthscale that differs as much between places
// two cells apart as these depths do, beams' noise left out. Of few beams to a cell the variance
// of the depths. There is a beam.
double fieldVariance(const std::vector<gmrf::CellPlace>& places, const Eigen::VectorXd& depth_m,
                     const gmrf::Model& model);

}  // namespace rbpf_core::smoothing
