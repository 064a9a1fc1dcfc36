// Loop closing: how well each particle's map predicts the latest ping (the paper's Algorithm 2).
#pragma once

#include <Eigen/Core>
#include <string>

namespace rbpf_core {

enum class WeightRule { kProduct, kRobust };

struct LoopClosureParams {
  WeightRule rule = WeightRule::kRobust;
  double noise_std_m = 0.3;  // sqrt(Q): sonar noise and what the map does not model
  double tempering = 1.0;    // tau, exponent of a prompt's likelihood; 1 is the paper's
  double min_n_eff_share =
      0.25;  // tau is lowered so that N_eff stays above this share of J; robust rule only
  // robust rule only:
  double effective_beams = 30.0;  // beams of a ping are not independent: it counts as this many
  double student_t_dof = 4.0;     // degrees of freedom of a beam's likelihood
  double min_overlap =
      0.3;  // share of (beam, particle) pairs over mapped seabed below which nothing is said
  double mapped_variance = 0.7;  // mapped: latent variance below this share of the prior's
  double veto_sigma =
      4.0;  // RMS normalised innovation of the best particle above which no map explains the ping
};

// The maps' predictions of one ping, row j by particle j's map at its own beam positions, latent
// (noise not included).
struct PingPrediction {
  Eigen::ArrayXXd mean_m;            // [J, n]
  Eigen::ArrayXXd variance_m2;       // [J, n]
  Eigen::ArrayXd prior_variance_m2;  // [J]
};

enum class PromptOutcome { kWeighted, kLittleOverlap, kVetoed };

struct PingLikelihood {
  PromptOutcome outcome = PromptOutcome::kLittleOverlap;
  Eigen::ArrayXd log_likelihood;  // [J]; meaningful when weighted
  double overlap = 0.0;           // share of (beam, particle) pairs over mapped seabed
  double best_innovation = 0.0;   // RMS normalised innovation of the best particle, sigma
};

// Log likelihood of the ping's depths z [n] for each particle.
// Product rule: sum over all beams of log N(z; mean, variance + Q), the paper's.
// Robust rule: see robustLikelihood in the source.
PingLikelihood pingLikelihood(const Eigen::ArrayXd& z_m, const PingPrediction& prediction,
                              const LoopClosureParams& params);

struct WeightUpdate {
  Eigen::ArrayXd log_weights;  // [J], normalised
  double tempering = 1.0;      // tau that was used
};

// log w += tau log likelihood. Robust rule: with the largest tau, up to params.tempering, that
// keeps N_eff at params.min_n_eff_share * J (or where it was, if that is lower).
WeightUpdate updateWeights(const Eigen::ArrayXd& log_weights, const Eigen::ArrayXd& log_likelihood,
                           const LoopClosureParams& params);

}  // namespace rbpf_core
