#include "gmrf/evidence.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "gmrf/simplex.hpp"
#include "gmrf/window.hpp"

namespace gmrf {

namespace {

// Weak priors, in logarithms: l about some ten nodes to a few hundred metres, and a noise of some
// centimetres to decimetres; factors of 4 and of 10 within one standard deviation.
constexpr double kLikelyLengthscale_m = 25.0;
constexpr double kLengthscaleLogStd = 1.4;
constexpr double kLikelyNoiseVariance_m2 = 0.01;
constexpr double kNoiseLogStd = 2.3;

constexpr int kSteps = 120;

double square(double x) { return x * x; }

double logPrior(const Model& model) {
  return -0.5 * square(std::log(model.lengthscale_m / kLikelyLengthscale_m) / kLengthscaleLogStd) -
         0.5 * square(std::log(model.noise_variance_m2 / kLikelyNoiseVariance_m2) / kNoiseLogStd);
}

}  // namespace

// log p = 1/2 log|Q| - 1/2 log|A| - 1/2 sum_i log(2 pi s^2 / w_i)
//         - 1/2 (sum_i w_i z_i^2 / s^2 - eta^T A^-1 eta),   A = Q + data, eta as in addData.
double logEvidence(const Sample& sample, const Model& model) {
  const FieldModel field(model);
  const double beam_variance = field.beamVariance();
  const double weight = sample.weights.sum();
  const double reference_m = sample.weights.dot(sample.beams.row(2).transpose()) / weight;
  Map map(model.spacing_m, reference_m);
  map.fold(sample.beams, sample.weights);

  std::vector<CellPlace> places;
  for (Eigen::Index i = 0; i < sample.beams.cols(); ++i) {
    places.push_back(cellOf(sample.beams(0, i), sample.beams(1, i), model.spacing_m));
  }
  const Window window(places, kMarginOfSample);
  EnvelopeMatrix Q = priorPrecision(window, model);
  EnvelopeMatrix A = Q;
  const WindowData data = addData(window, map.sums(), beam_variance, &A);
  Q.factorise();
  A.factorise();
  Eigen::VectorXd x = data.information;
  A.solve(&x);

  const Eigen::ArrayXd z = (sample.beams.row(2).array() - reference_m).transpose();
  const Eigen::ArrayXd w = sample.weights.array();
  const double fit = (w * z.square()).sum() / beam_variance - data.information.dot(x);
  const double noise = (2.0 * M_PI * beam_variance / w.max(1e-12)).log().sum();
  return 0.5 * (Q.logDeterminant() - A.logDeterminant() - noise - fit);
}

Model mostEvident(const std::vector<Sample>& samples, const Model& start) {
  start.check();
  const auto modelAt = [&start](const Point3& logs) {
    Model model = start;
    model.lengthscale_m = std::exp(logs[0]);
    model.outputscale_m2 = std::exp(logs[1]);
    model.noise_variance_m2 = std::exp(logs[2]);
    return model;
  };
  const auto loss = [&](const Point3& logs) {
    const Model model = modelAt(logs);
    // Below two nodes the grid says nothing of l, and far beyond the sample nothing does.
    if (model.lengthscale_m < 2.0 * start.spacing_m || logs[0] > 10.0) return 1e300;
    if (std::abs(logs[1]) > 25.0 || std::abs(logs[2]) > 25.0) return 1e300;
    double sum = -logPrior(model);
    for (const Sample& sample : samples) {
      try {
        sum -= logEvidence(sample, model);
      } catch (const std::domain_error&) {  // not positive definite: too extreme for its numbers
        return 1e300;
      }
    }
    return std::isfinite(sum) ? sum : 1e300;
  };
  return modelAt(minimum(loss,
                         {std::log(start.lengthscale_m), std::log(start.outputscale_m2),
                          std::log(start.noise_variance_m2)},
                         kSteps));
}

}  // namespace gmrf
