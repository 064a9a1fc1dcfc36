// What a prompt costs the core itself: the weights of J particles from n beams, and how many maps
// change node in the resampling that follows. Prints JSON.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <limits>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include "rbpf_core/random.hpp"
#include "rbpf_core/resampling.hpp"
#include "rbpf_core/weighting.hpp"

namespace {

using rbpf_core::RandomStream;
using Indices = std::vector<std::uint32_t>;

constexpr Eigen::Index kParticles = 100;
constexpr Eigen::Index kBeams = 512;
constexpr int kRepeats = 20;
constexpr int kResamplings = 1000;
// Of the log weights. About half of the particles are then replaced.
constexpr double kLogWeightStd = 1.4;

Eigen::ArrayXXd normal(Eigen::Index rows, Eigen::Index columns, RandomStream* stream) {
  std::normal_distribution<double> distribution;
  return Eigen::ArrayXXd::NullaryExpr(rows, columns, [&] { return distribution(*stream); });
}

// Shortest wall time, s, from predictions to new weights.
double secondsToWeigh(rbpf_core::WeightRule rule) {
  RandomStream stream(1);
  rbpf_core::WeightingParams params;
  params.rule = rule;
  const rbpf_core::PingPrediction prediction{0.3 * normal(kParticles, kBeams, &stream),
                                             normal(kParticles, kBeams, &stream).square() * 0.01,
                                             Eigen::ArrayXd::Ones(kParticles)};
  const Eigen::ArrayXd z_m = 0.3 * normal(kBeams, 1, &stream);
  const Eigen::ArrayXd log_weights =
      Eigen::ArrayXd::Constant(kParticles, -std::log(static_cast<double>(kParticles)));
  double shortest_s = std::numeric_limits<double>::infinity();
  for (int i = 0; i < kRepeats; ++i) {
    const auto start = std::chrono::steady_clock::now();
    const auto likelihood = rbpf_core::pingLikelihood(z_m, prediction, params);
    rbpf_core::updateWeights(log_weights, likelihood.log_likelihood, params);
    const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
    shortest_s = std::min(shortest_s, elapsed.count());
  }
  return shortest_s;
}

// As systematic resampling draws them: in the order of their ancestors.
Indices plainNumbering(const Indices& offspring) {
  Indices ancestors;
  for (std::uint32_t j = 0; j < offspring.size(); ++j) {
    ancestors.insert(ancestors.end(), offspring[j], j);
  }
  return ancestors;
}

// A node fetches a map once, however many of its particles inherit it.
std::size_t mapsMoved(const Indices& ancestors, const Indices& node_of) {
  std::set<std::pair<std::uint32_t, std::uint32_t>> fetched;  // node, ancestor
  for (std::size_t j = 0; j < ancestors.size(); ++j) {
    if (node_of[ancestors[j]] != node_of[j]) fetched.emplace(node_of[j], ancestors[j]);
  }
  return fetched.size();
}

struct Traffic {
  double plain = 0.0;     // maps that change node per resampling
  double ours = 0.0;      // the same with numberOffspring
  double replaced = 0.0;  // share of the particles
};

Traffic meanTraffic(std::size_t nodes) {
  RandomStream stream(1);
  const Indices node_of = rbpf_core::shareParticles(kParticles, nodes);
  Traffic sum;
  for (int i = 0; i < kResamplings; ++i) {
    const Eigen::ArrayXd log_weights = kLogWeightStd * normal(kParticles, 1, &stream);
    const Indices offspring =
        rbpf_core::systematicOffspring(rbpf_core::normalisedWeights(log_weights), stream.uniform());
    sum.plain += static_cast<double>(mapsMoved(plainNumbering(offspring), node_of));
    sum.ours +=
        static_cast<double>(mapsMoved(rbpf_core::numberOffspring(offspring, node_of), node_of));
    sum.replaced += static_cast<double>(std::count(offspring.begin(), offspring.end(), 0U));
  }
  const double resamplings = kResamplings;
  return {sum.plain / resamplings, sum.ours / resamplings,
          sum.replaced / resamplings / static_cast<double>(kParticles)};
}

}  // namespace

int main() {
  std::printf("{\"weights_ms\": {\"robust\": %.3f, \"product\": %.3f}, \"numbering\": {",
              1e3 * secondsToWeigh(rbpf_core::WeightRule::kRobust),
              1e3 * secondsToWeigh(rbpf_core::WeightRule::kProduct));
  const char* separator = "";
  for (const std::size_t nodes : {2U, 4U, 10U, 32U}) {
    const Traffic traffic = meanTraffic(nodes);
    std::printf("%s\"%zu\": {\"plain\": %.2f, \"ours\": %.2f, \"replaced_share\": %.3f}", separator,
                nodes, traffic.plain, traffic.ours, traffic.replaced);
    separator = ", ";
  }
  std::printf("}}\n");
}
