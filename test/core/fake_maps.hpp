// Maps without any map in them, for the tests of loop closing: they predict what a test wants, and
// fail when it wants.
#pragma once

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <functional>
#include <string>
#include <vector>

#include "rbpf_core/loop_closing.hpp"
#include "survey.hpp"

namespace rbpf_core {

class FakeMaps : public Maps {
 public:
  explicit FakeMaps(std::size_t particles, std::size_t nodes = 2)
      : error_m(Eigen::ArrayXd::Zero(static_cast<Eigen::Index>(particles))),
        ready(particles),
        epoch_of(nodes, 0),
        past_of(nodes, 0),
        node_of_(shareParticles(particles, nodes)) {}

  MapsState state(std::uint32_t epoch) const override {
    MapsState state;
    state.nodes = epoch_of.size();
    for (std::size_t k = 0; k < epoch_of.size(); ++k) {
      if (epoch_of[k] != epoch) continue;
      ++state.nodes_heard;
      state.pasts.push_back(past_of[k]);
    }
    state.maps_ready = ready;
    state.elbo = elbo;
    return state;
  }

  const std::vector<std::uint32_t>& nodeOf() const override { return node_of_; }

  PingPrediction predict(std::uint32_t epoch, const PlacedPing& ping) override {
    calls.push_back("predict " + std::to_string(epoch));
    pings.push_back(ping);
    const auto J = static_cast<Eigen::Index>(ping.poses.size());
    const Eigen::ArrayXd z_m = ping.levelled_m.row(2).transpose().cast<double>();
    PingPrediction prediction{error_m.replicate(1, z_m.size()),
                              Eigen::ArrayXXd::Constant(J, z_m.size(), 0.04),
                              Eigen::ArrayXd::Constant(J, 4.0)};
    prediction.mean_m.rowwise() += z_m.transpose();
    if (on_predict) on_predict(&prediction);
    return prediction;
  }

  MovedMaps prepare(std::uint32_t epoch, const std::vector<std::uint32_t>& of_all) override {
    calls.push_back("prepare " + std::to_string(epoch));
    ancestors = of_all;
    if (on_prepare) on_prepare();
    return {2, 1000};
  }

  void commit(std::uint32_t epoch) override {
    calls.push_back("commit " + std::to_string(epoch));
    if (on_commit) on_commit();
    epoch_of.assign(epoch_of.size(), epoch);
  }

  void abort(std::uint32_t epoch) override {
    calls.push_back("abort " + std::to_string(epoch));
    if (on_abort) on_abort();
  }

  // What a test wants: each map's error, [J], and what happens when the maps are asked.
  Eigen::ArrayXd error_m;
  std::function<void(PingPrediction* prediction)> on_predict;
  std::function<void()> on_prepare, on_commit, on_abort;
  Eigen::ArrayXd elbo;                  // [J], that the maps report
  std::size_t ready;                    // maps that report to be ready
  std::vector<std::uint32_t> epoch_of;  // [B], that each node reports
  std::vector<std::uint32_t> past_of;   // [B], the same

  // What they have been asked.
  std::vector<std::string> calls;
  std::vector<PlacedPing> pings;
  std::vector<std::uint32_t> ancestors;

 private:
  const std::vector<std::uint32_t> node_of_;
};

// Four particles on noisy tracks, 30 s of survey, the paper's product rule, and never a resampling
// unless a test wants one.
class LoopClosingTest : public testing::Test {
 protected:
  static constexpr std::size_t kParticles = 4;

  static LoopClosingParams productRule(double threshold) {
    LoopClosingParams params;
    params.weighting.rule = WeightRule::kProduct;
    params.resample_when = OnEffectiveSizeDrop{threshold};
    return params;
  }

  LoopClosingTest() { sail(filter, turning, 0, 30); }

  // Takes in more of the survey, so that the next prompt is due.
  void sailOn() {
    sail(filter, turning, sailed_s_, sailed_s_ + 10);
    sailed_s_ += 10;
  }

  Eigen::ArrayXd weights() const { return filter.snapshot().logWeights().exp(); }
  bool weightsAreUniform() const { return (weights() - 0.25).abs().maxCoeff() < 1e-12; }

  ParticleFilter filter{noisyParams(kParticles)};
  FakeMaps maps{kParticles};
  LoopClosing closing{filter, maps, productRule(0.0)};

 private:
  int sailed_s_ = 30;
};

}  // namespace rbpf_core
