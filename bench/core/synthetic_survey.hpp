// Surveys of the paper's largest size, made of random numbers: what is measured on them does not
// depend on where the beams lie.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <random>
#include <vector>

#include "rbpf_core/random.hpp"
#include "rbpf_core/resampling.hpp"
#include "rbpf_core/types.hpp"

namespace bench {

struct Size {
  std::size_t particles = 100;        // J
  std::uint32_t pings = 50000;        // over 2.25 h: 6 a second
  Eigen::Index beams_per_ping = 248;  // 12.4 million in all
};

// Ancestors [J] of a systematic resampling that replaces about half of the particles: weights that
// are log-normal with a standard deviation of 1.6 give N_eff of about J/5 and 50 survivors.
inline std::vector<std::uint32_t> randomAncestors(std::size_t particles,
                                                  rbpf_core::RandomStream* stream) {
  std::normal_distribution<double> normal(0.0, 1.6);
  Eigen::ArrayXd log_weights(static_cast<Eigen::Index>(particles));
  for (double& log_weight : log_weights) log_weight = normal(*stream);
  const Eigen::ArrayXd weights = rbpf_core::normalisedWeights(log_weights);
  const auto offspring = rbpf_core::systematicOffspring(weights, stream->uniform());
  return rbpf_core::numberOffspring(offspring, rbpf_core::shareParticles(particles, 2));
}

// Calls append(poses, beams) for every ping and resample(ancestors) `resamplings` times, evenly
// spread and not after the last ping.
template <typename Append, typename Resample>
void makeSurvey(const Size& size, std::uint32_t resamplings, const Append& append,
                const Resample& resample) {
  rbpf_core::RandomStream stream(1);
  std::vector<rbpf_core::Pose2> poses(size.particles);
  rbpf_core::Beams beams(3, size.beams_per_ping);
  const std::uint32_t interval = size.pings / (resamplings + 1);
  for (std::uint32_t ping = 0; ping < size.pings; ++ping) {
    for (rbpf_core::Pose2& pose : poses) {
      pose = {1000.0 * stream.uniform(), 1000.0 * stream.uniform(), stream.uniform()};
    }
    beams.setConstant(static_cast<float>(stream.uniform()));
    append(poses, beams);
    if ((ping + 1) % interval == 0 && (ping + 1) / interval <= resamplings) {
      resample(randomAncestors(size.particles, &stream));
    }
  }
}

}  // namespace bench
