// A track that goes over the same ground twice, for pose graphs. Seeds are fixed.
#pragma once

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "dense_graph.hpp"
#include "rbpf_core/smoothing/pose_graph.hpp"

namespace rbpf_core::smoothing {

inline Eigen::Vector3d difference(const Pose2& a, const Pose2& b) {
  return {a.x_m - b.x_m, a.y_m - b.y_m, wrapAngle(a.yaw_rad - b.yaw_rad)};
}

inline Eigen::Matrix3d diagonal(double std_m, double std_rad) {
  return Eigen::Vector3d(std_m, std_m, std_rad).cwiseAbs2().asDiagonal();
}

struct SolvedGraph : PoseGraph {
  SolvedGraph(const SmoothingParams& params, const GivenTrack& given)
      : PoseGraph(params, given.stamps_s.front(), given.start) {
    for (std::size_t i = 0; i < given.moved.size(); ++i) {
      addNode(given.stamps_s[i + 1], given.moved[i]);
    }
    for (const GivenClosure& c : given.closures) addClosure(c.k, c.j, c.relative);
    for (const GivenFix& f : given.fixes) addFix(f.node, f.position_m, f.covariance_m2);
    solve();
  }
};

// Twice around a rounded square of some 100 m, 1.5 m/s, 10 s between nodes.
struct Loop {
  SmoothingParams params;
  MotionBias bias;
  GivenTrack given;
  std::vector<Pose2> truth;

  explicit Loop(std::uint32_t seed, const MotionBias& true_bias = {}, double noise = 1.0)
      : bias(true_bias) {
    params.start_position_std_m = 0.1;
    params.start_yaw_std_rad = 0.002;
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    constexpr double kPeriod_s = 10.0;
    const Pose2 start{20.0, -30.0, 2.5};
    given.start = start;
    given.stamps_s = {1000.0};
    truth = {start};
    for (int i = 0; i < 64; ++i) {
      const double turn = i % 8 < 6 ? 0.0 : M_PI / 4.0;
      truth.push_back(compose(truth.back(), {1.5 * kPeriod_s, 0.0, turn}));
      const double root_s = std::sqrt(kPeriod_s);
      given.moved.push_back(
          {1.5 * kPeriod_s + bias.surge_mps * kPeriod_s +
               noise * params.motion.surge_std_m * root_s * normal(random),
           bias.sway_mps * kPeriod_s + noise * params.motion.sway_std_m * root_s * normal(random),
           turn + bias.yaw_radps * kPeriod_s +
               noise * params.motion.yaw_std_rad * root_s * normal(random)});
      given.stamps_s.push_back(given.stamps_s.back() + kPeriod_s);
    }
    for (std::size_t j = 32; j < truth.size(); j += 2) {
      const Pose2 seen = relative(truth[j - 32], truth[j]);
      const Pose2 error{0.1 * noise * normal(random), 0.1 * noise * normal(random),
                        0.005 * noise * normal(random)};
      given.closures.push_back(
          {j - 32,
           j,
           {{seen.x_m + error.x_m, seen.y_m + error.y_m, wrapAngle(seen.yaw_rad + error.yaw_rad)},
            diagonal(0.1, 0.005)}});
    }
  }

  std::vector<Pose2> deadReckoning() const {
    std::vector<Pose2> poses{given.start};
    for (const Pose2& moved : given.moved) poses.push_back(compose(poses.back(), moved));
    return poses;
  }
};

// Solutions end where the cost falls by less than 1e-5 of itself: of a cost of some tens, within a
// hundredth of a standard deviation.
constexpr double kSolved = 0.02;

// In standard deviations of each node.
inline void expectDense(const PoseGraph& graph, const DenseGraph& dense) {
  const PoseGraph::Covariances covariances(graph);
  for (std::size_t i = 0; i < graph.size(); i += 3) {
    const Eigen::Matrix3d expected = dense.covariance(i);
    const Eigen::Vector3d std = expected.diagonal().cwiseSqrt();
    const Eigen::Vector3d off = difference(graph.pose(i), dense.pose(i));
    EXPECT_LT(off.cwiseQuotient(std).cwiseAbs().maxCoeff(), kSolved) << i;
    const Eigen::Matrix3d scaled = std.cwiseInverse().asDiagonal() *
                                   (covariances.of(i) - expected) * std.cwiseInverse().asDiagonal();
    EXPECT_LT(scaled.cwiseAbs().maxCoeff(), kSolved) << i;
  }
}

}  // namespace rbpf_core::smoothing
