#include "rbpf_core/resampling.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <string>

namespace rbpf_core {

Eigen::ArrayXd normalisedWeights(const Eigen::ArrayXd& log_weights) {
  const double largest = log_weights.maxCoeff<Eigen::PropagateNaN>();
  if (!std::isfinite(largest)) {
    throw std::domain_error("largest log weight is " + std::to_string(largest) +
                            ", expected a finite value");
  }
  const Eigen::ArrayXd relative = (log_weights - largest).exp();
  return relative / relative.sum();
}

double effectiveParticles(const Eigen::ArrayXd& weights) { return 1.0 / weights.square().sum(); }

bool OnEffectiveSizeDrop::operator()(const Eigen::ArrayXd& weights) const {
  // equal weights have J but for rounding, whatever the share
  constexpr double kRounding = 1e-12;
  return effectiveParticles(weights) <
         share * (1.0 - kRounding) * static_cast<double>(weights.size());
}

std::vector<std::uint32_t> systematicOffspring(const Eigen::ArrayXd& weights, double u) {
  const auto particles = static_cast<double>(weights.size());
  // summed in the same order as below, so that the last weight brings `cumulated` to `total`
  // exactly
  const double total = std::accumulate(weights.begin(), weights.end(), 0.0);
  const double below_particles = std::nextafter(particles, 0.0);
  std::vector<std::uint32_t> offspring;
  double cumulated = 0.0;
  // J evenly spaced points, u, 1 + u, .., J - 1 + u: a particle has as many offspring as lie in its
  // share of [0, J)
  double point = u;
  double drawn = 0.0;
  for (const double weight : weights) {
    cumulated += weight;
    offspring.push_back(0);
    while (drawn < particles && std::min(point, below_particles) < cumulated / total * particles) {
      ++offspring.back();
      point = ++drawn + u;
    }
  }
  return offspring;
}

std::vector<std::uint32_t> numberOffspring(const std::vector<std::uint32_t>& offspring,
                                           const std::vector<std::uint32_t>& node_of) {
  const std::size_t particles = offspring.size();
  constexpr auto kFree = static_cast<std::uint32_t>(-1);
  std::vector<std::uint32_t> ancestors(particles, kFree);
  std::vector<std::uint32_t> left = offspring;
  for (std::uint32_t j = 0; j < particles; ++j) {  // survivors stay
    if (left[j] == 0) continue;
    ancestors[j] = j;
    --left[j];
  }
  // Those with few further offspring first: where a node's free numbers run out, the rest of one
  // large family crosses over, which costs one map, rather than one each of several.
  std::vector<std::uint32_t> order(particles);
  std::iota(order.begin(), order.end(), 0U);
  std::stable_sort(order.begin(), order.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return left[a] < left[b]; });
  for (const bool same_node_only : {true, false}) {
    for (const std::uint32_t j : order) {
      for (std::uint32_t slot = 0; slot < particles && left[j] > 0; ++slot) {
        if (ancestors[slot] != kFree) continue;
        if (same_node_only && node_of[slot] != node_of[j]) continue;
        ancestors[slot] = j;
        --left[j];
      }
    }
  }
  return ancestors;
}

std::vector<std::uint32_t> shareParticles(std::size_t particles, std::size_t nodes) {
  std::vector<std::uint32_t> node_of;
  for (std::size_t node = 0; node < nodes; ++node) {
    const std::size_t share = particles / nodes + (node < particles % nodes ? 1 : 0);
    node_of.insert(node_of.end(), share, static_cast<std::uint32_t>(node));
  }
  return node_of;
}

}  // namespace rbpf_core
