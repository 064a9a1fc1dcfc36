#include "rbpf_core/weighting.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "rbpf_core/resampling.hpp"

namespace rbpf_core {

namespace {

constexpr int kBisections = 40;  // of tau in [0, 1]: to 1e-12

void check(const Eigen::ArrayXd& z_m, const PingPrediction& prediction) {
  const Eigen::ArrayXXd& mean = prediction.mean_m;
  if (mean.cols() != z_m.size() || mean.rows() != prediction.prior_variance_m2.size() ||
      prediction.variance_m2.rows() != mean.rows() ||
      prediction.variance_m2.cols() != mean.cols()) {
    throw std::invalid_argument("prediction of " + std::to_string(mean.rows()) + " x " +
                                std::to_string(mean.cols()) + " depths, expected " +
                                std::to_string(prediction.prior_variance_m2.size()) + " x " +
                                std::to_string(z_m.size()));
  }
  const auto isVariance = [](const auto& values) {
    return values.allFinite() && values.minCoeff() >= 0.0;
  };
  if (!mean.allFinite() || !isVariance(prediction.variance_m2) ||
      !(isVariance(prediction.prior_variance_m2) &&
        prediction.prior_variance_m2.minCoeff() > 0.0)) {
    throw std::invalid_argument(
        "prediction holds a mean that is not finite or a variance that is not finite and positive");
  }
}

// sum_i log N(z_i; mu_ij, var_ij + Q)
PingLikelihood productLikelihood(const Eigen::ArrayXd& z_m, const PingPrediction& prediction,
                                 const WeightingParams& params) {
  const Eigen::ArrayXXd residual = prediction.mean_m.rowwise() - z_m.transpose();
  const Eigen::ArrayXXd variance = prediction.variance_m2 + params.noise_std_m * params.noise_std_m;
  PingLikelihood result;
  result.outcome = PromptOutcome::kWeighted;
  result.overlap = 1.0;
  result.log_likelihood =
      -0.5 * (residual.square() / variance + (2.0 * M_PI * variance).log()).rowwise().sum();
  result.best_innovation = std::sqrt((residual.square() / variance).rowwise().mean().minCoeff());
  return result;
}

// A beam votes in a particle only where that particle's map is mapped. Overlap must neither attract
// nor repel, so the *mean* over a particle's voting beams counts, scaled for all particles alike by
// the overall share of voting beams; all use one common variance per beam, without its log; and a
// particle with hardly any voting beam gets the others' median:
//   l_j = n_effective * overlap * mean_i -(nu + 1)/2 * log(1 + (z_i - mu_ij)^2 / (nu s_i^2))
PingLikelihood robustLikelihood(const Eigen::ArrayXd& z_m, const PingPrediction& prediction,
                                const WeightingParams& params) {
  const Eigen::ArrayXXd share_of_prior =
      prediction.variance_m2.colwise() / prediction.prior_variance_m2;
  const Eigen::ArrayXXd mapped = (share_of_prior < params.mapped_variance).cast<double>();
  PingLikelihood result;
  result.overlap = mapped.size() == 0 ? 0.0 : mapped.mean();
  if (result.overlap < params.min_overlap) return result;

  const Eigen::ArrayXd voters_of_beam = mapped.colwise().sum().max(1.0).transpose();
  const Eigen::ArrayXd scale2 =
      (mapped * prediction.variance_m2).colwise().sum().transpose() / voters_of_beam +
      params.noise_std_m * params.noise_std_m;
  const Eigen::ArrayXXd normalised2 =
      (prediction.mean_m.rowwise() - z_m.transpose()).square().rowwise() / scale2.transpose();

  const double nu = params.student_t_dof;
  const Eigen::ArrayXd votes = mapped.rowwise().sum();
  const Eigen::ArrayXd mean_log =
      -0.5 * (nu + 1.0) * (mapped * (normalised2 / nu).log1p()).rowwise().sum() / votes.max(1.0);
  const Eigen::ArrayXd innovation2 = (mapped * normalised2).rowwise().sum() / votes.max(1.0);

  const double enough_votes = 0.5 * params.min_overlap * static_cast<double>(z_m.size());
  std::vector<double> heard;
  double least_innovation2 = std::numeric_limits<double>::infinity();
  for (Eigen::Index j = 0; j < votes.size(); ++j) {
    if (votes(j) < enough_votes) continue;
    heard.push_back(mean_log(j));
    least_innovation2 = std::min(least_innovation2, innovation2(j));
  }
  const auto middle = heard.begin() + static_cast<std::ptrdiff_t>(heard.size() / 2);
  std::nth_element(heard.begin(), middle, heard.end());

  result.best_innovation = std::sqrt(least_innovation2);
  result.outcome = result.best_innovation > params.veto_sigma ? PromptOutcome::kVetoed
                                                              : PromptOutcome::kWeighted;
  result.log_likelihood =
      params.effective_beams * result.overlap * (votes >= enough_votes).select(mean_log, *middle);
  return result;
}

Eigen::ArrayXd tempered(const Eigen::ArrayXd& log_weights, const Eigen::ArrayXd& log_likelihood,
                        double tau) {
  if (tau == 0.0) return normalisedWeights(log_weights);  // 0 times -infinity is no number
  return normalisedWeights(log_weights + tau * log_likelihood);
}

}  // namespace

PingLikelihood pingLikelihood(const Eigen::ArrayXd& z_m, const PingPrediction& prediction,
                              const WeightingParams& params) {
  check(z_m, prediction);
  return params.rule == WeightRule::kProduct ? productLikelihood(z_m, prediction, params)
                                             : robustLikelihood(z_m, prediction, params);
}

Eigen::ArrayXd elboLikelihood(const Eigen::ArrayXd& elbo, double elbo_beams) {
  if (!elbo.allFinite()) {
    throw std::invalid_argument("a map's ELBO is not finite, lc/elbo_beams needs that of each");
  }
  return elbo_beams * elbo;
}

WeightUpdate updateWeights(const Eigen::ArrayXd& log_weights, const Eigen::ArrayXd& log_likelihood,
                           const WeightingParams& params) {
  if (log_likelihood.size() != log_weights.size()) {
    throw std::invalid_argument("likelihoods of " + std::to_string(log_likelihood.size()) +
                                " particles, expected " + std::to_string(log_weights.size()));
  }
  double tau = params.tempering;
  const auto nEff = [&](double t) {
    return effectiveParticles(tempered(log_weights, log_likelihood, t));
  };
  if (params.rule == WeightRule::kRobust) {
    const double target =
        std::min(params.min_n_eff_share * static_cast<double>(log_weights.size()), nEff(0.0));
    if (nEff(tau) < target) {
      double kept = 0.0;
      for (int i = 0; i < kBisections; ++i) {
        const double middle = 0.5 * (kept + tau);
        (nEff(middle) < target ? tau : kept) = middle;
      }
      tau = kept;
    }
  }
  const Eigen::ArrayXd weights = tempered(log_weights, log_likelihood, tau);
  // a weight that has vanished stays a number: it can never come back, but must not make NaN
  return {weights.max(std::numeric_limits<double>::min()).log(), tau};
}

}  // namespace rbpf_core
