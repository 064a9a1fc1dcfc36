// Weighting the particles by how well their maps predict a ping (the paper's Algorithm 2).
#pragma once

#include <Eigen/Core>

#include "rbpf_core/types.hpp"

namespace rbpf_core {

// kProduct is the paper's; see the functions of these names in the source.
enum class WeightRule { kProduct, kRobust };

// Defaults are those of config/default.yaml.
struct WeightingParams {
  WeightRule rule = WeightRule::kRobust;
  // sqrt(Q): sonar noise and what the map does not model.
  double noise_std_m = 0.3;
  // tau, the exponent of a prompt's likelihood; 1 is the paper's.
  double tempering = 1.0;
  // A map's training objective, the ELBO per beam, counts as so many beams' log likelihood; 0: not
  // at all, as in the paper, which proposes it for further research.
  double elbo_beams = 0.0;

  // The rest is of the robust rule only.

  // tau is lowered so that N_eff stays above this share of J.
  double min_n_eff_share = 0.25;
  // A ping counts as this many beams, since its beams are not independent.
  double effective_beams = 12.0;
  // Degrees of freedom of a beam's likelihood.
  double student_t_dof = 4.0;
  // Share of (beam, particle) pairs over mapped seabed below which nothing is said.
  double min_overlap = 0.3;
  // Seabed is mapped where the latent variance is below this share of the prior's.
  double mapped_variance = 0.7;
  // RMS normalised innovation of the best particle above which no map explains the ping.
  double veto_sigma = 4.0;
};

enum class PromptOutcome { kWeighted, kLittleOverlap, kVetoed };

struct PingLikelihood {
  PromptOutcome outcome = PromptOutcome::kLittleOverlap;
  // [J]; meaningful when weighted.
  Eigen::ArrayXd log_likelihood;
  // Share of (beam, particle) pairs over mapped seabed.
  double overlap = 0.0;
  // RMS normalised innovation of the best particle, sigma.
  double best_innovation = 0.0;
};

// Log likelihood of the ping's depths z [n] for each particle. Throws std::invalid_argument unless
// the prediction is of J x n finite numbers, and its variances positive.
// Product rule: sum over all beams of log N(z; mean, variance + Q), the paper's.
// Robust rule: see robustLikelihood in the source.
PingLikelihood pingLikelihood(const Eigen::ArrayXd& z_m, const PingPrediction& prediction,
                              const WeightingParams& params);

// What the maps' ELBO per beam [J], in nats, adds to the log likelihood of a prompt. Throws
// std::invalid_argument unless all are finite.
Eigen::ArrayXd elboLikelihood(const Eigen::ArrayXd& elbo, double elbo_beams);

struct WeightUpdate {
  // [J], normalised.
  Eigen::ArrayXd log_weights;
  // tau that was used.
  double tempering = 1.0;
};

// log w += tau log likelihood. Robust rule: with the largest tau, up to params.tempering, that
// keeps N_eff at params.min_n_eff_share * J (or where it was, if that is lower). Throws
// std::invalid_argument unless there is a likelihood for each weight.
WeightUpdate updateWeights(const Eigen::ArrayXd& log_weights, const Eigen::ArrayXd& log_likelihood,
                           const WeightingParams& params);

}  // namespace rbpf_core
