// Weights, effective number of particles, when to resample, systematic resampling, numbering of the
// offspring.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <vector>

namespace rbpf_core {

// Weights that sum to one, from log weights, by log-sum-exp. Throws std::domain_error if a log
// weight is NaN or +infinite, or all are -infinite.
Eigen::ArrayXd normalisedWeights(const Eigen::ArrayXd& log_weights);

// 1 / sum w^2, between 1 and J.
double effectiveParticles(const Eigen::ArrayXd& weights);

// When to resample: asked after every prompt, with the normalised weights [J].
using ResamplingPolicy = std::function<bool(const Eigen::ArrayXd& weights)>;

// When N_eff has fallen below this share of J. (The paper's text says "greater", which contradicts
// its reference and its own implementation.)
struct OnEffectiveSizeDrop {
  double share = 0.5;

  bool operator()(const Eigen::ArrayXd& weights) const;
};

// Offspring of each particle by systematic resampling with the one draw u in [0, 1): particle j
// gets floor(J w_j) or ceil(J w_j); the counts always sum to J.
std::vector<std::uint32_t> systematicOffspring(const Eigen::ArrayXd& weights, double u);

// Particles are exchangeable, so the offspring are numbered such that as few maps as possible
// change node: survivors stay where they are, further offspring take the free numbers of their
// own node first. node_of: [J] the node that holds each particle's map. Returns ancestors [J].
std::vector<std::uint32_t> numberOffspring(const std::vector<std::uint32_t>& offspring,
                                           const std::vector<std::uint32_t>& node_of);

// Which node holds which particle: contiguous shares that differ by at most one, any J, any B. [J]
std::vector<std::uint32_t> shareParticles(std::size_t particles, std::size_t nodes);

}  // namespace rbpf_core
