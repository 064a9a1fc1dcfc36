#include "gmrf/robust_weights.hpp"

#include <algorithm>
#include <cmath>

#include "gmrf/robust_spread.hpp"

namespace gmrf {

namespace {

constexpr double kDegreesOfFreedom = 4.0;
constexpr int kIterations = 6;

}  // namespace

// The scale begins at the residuals' own, as outliers have pulled the first field away from the
// seabed, and comes down to the model's.
Eigen::VectorXd robustWeights(Map& map, const FieldModel& field, const Beams& beams) {
  Eigen::VectorXd weights = Eigen::VectorXd::Ones(beams.cols());
  if (beams.cols() == 0) return weights;
  const Points places = beams.topRows<2>();
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    Map trial = map.share();
    trial.fold(beams, weights);
    const Prediction seabed = trial.predict(places, field, Variances::kNone);
    const Eigen::ArrayXd residual = beams.row(2).transpose() - seabed.mean_m;
    const double spread_m = robustStd(residual.matrix());
    const double scale2 = std::max(field.beamVariance(), spread_m * spread_m);
    weights =
        ((kDegreesOfFreedom + 1.0) / (kDegreesOfFreedom + residual.square() / scale2)).min(1.0);
  }
  return weights;
}

}  // namespace gmrf
