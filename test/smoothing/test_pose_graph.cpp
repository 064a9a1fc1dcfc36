#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <random>
#include <stdexcept>

#include "../core/statistics.hpp"
#include "dense_graph.hpp"
#include "loop.hpp"
#include "rbpf_core/smoothing/pose_graph.hpp"

namespace rbpf_core::smoothing {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

// ---- dead reckoning ----------------------------------------------------------------------------

TEST(PoseGraph, WithoutClosuresIsDeadReckoning) {
  const Loop loop(1);
  GivenTrack given = loop.given;
  given.closures.clear();
  const SolvedGraph graph(loop.params, given);
  const std::vector<Pose2> expected = loop.deadReckoning();
  ASSERT_EQ(graph.size(), expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i) {
    EXPECT_LT(difference(graph.pose(i), expected[i]).norm(), 1e-9) << i;
  }
  EXPECT_LT(std::abs(graph.bias().surge_mps) + std::abs(graph.bias().yaw_radps), 1e-12);
}

using BiasVector = Eigen::Matrix<double, 5, 1>;  // as DenseGraph has them

// The ways that the motion model's particles go, in steps of a fifth of a second, with biases.
Eigen::MatrixXd sampledEnds(const SmoothingParams& params, const std::vector<double>& turns_rad,
                            Eigen::Index samples) {
  constexpr double kStep_s = 0.2;
  constexpr int kSteps = 10;  // between nodes
  const double kept = std::exp(-60.0 / params.bias_time_s);
  BiasVector bias_std;
  bias_std << params.velocity_bias_std_mps, params.velocity_bias_std_mps, params.yaw_bias_std_radps,
      params.current_std_mps, params.current_std_mps;
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  const auto drawn = [&](Eigen::Index numbers) {
    return Eigen::VectorXd::NullaryExpr(numbers, [&] { return normal(random); });
  };
  Eigen::MatrixXd ends(samples, 3);
  for (Eigen::Index sample = 0; sample < samples; ++sample) {
    RandomStream stream(static_cast<std::uint64_t>(sample));
    const Eigen::Vector3d start = drawn(3).cwiseProduct(Eigen::Vector3d(
        params.start_position_std_m, params.start_position_std_m, params.start_yaw_std_rad));
    Pose2 pose{start.x(), start.y(), start.z()};
    BiasVector bias = drawn(5).cwiseProduct(bias_std);
    double stamp_s = 0.0;
    double bias_stamp_s = 0.0;
    for (const double turn_rad : turns_rad) {
      if (stamp_s - bias_stamp_s >= 60.0 - 1e-9) {
        bias = kept * bias + std::sqrt(1.0 - kept * kept) * drawn(5).cwiseProduct(bias_std);
        bias_stamp_s = stamp_s;
      }
      for (int step = 0; step < kSteps; ++step) {
        const MotionIncrement motion{kStep_s, (1.5 - bias(0)) * kStep_s, -bias(1) * kStep_s,
                                     turn_rad / kSteps - bias(2) * kStep_s};
        pose = advanceNoisily(pose, motion, params.motion, stream);
        pose.x_m += bias(3) * kStep_s;
        pose.y_m += bias(4) * kStep_s;
      }
      stamp_s += 2.0;
    }
    ends.row(sample) << pose.x_m, pose.y_m, pose.yaw_rad;
  }
  return ends;
}

TEST(PoseGraph, KnowsAsMuchOfAChainAsTheMotionModelDoes) {
  SmoothingParams params;
  params.motion = {0.05, 0.08, 0.002};
  params.velocity_bias_std_mps = 0.02;
  params.yaw_bias_std_radps = 2e-4;
  params.current_std_mps = 0.03;
  params.bias_time_s = 300.0;
  params.start_position_std_m = 0.2;
  params.start_yaw_std_rad = 0.01;
  std::vector<double> turns_rad(75, 0.0);  // 150 s, three biases
  for (std::size_t i = 20; i < 30; ++i) turns_rad[i] = 0.15;
  PoseGraph graph(params, 0.0, {});
  for (std::size_t i = 0; i < turns_rad.size(); ++i) {
    const double turn = turns_rad[i];
    Pose2 moved;
    for (int step = 0; step < 10; ++step) moved = advance(moved, {0.2, 0.3, 0.0, turn / 10.0});
    graph.addNode(2.0 * static_cast<double>(i + 1), moved);
  }
  graph.solve();
  const Eigen::Matrix3d expected = PoseGraph::Covariances(graph).of(graph.size() - 1);
  constexpr Eigen::Index kSamples = 3000;
  const Moments sampled = momentsOf(sampledEnds(params, turns_rad, kSamples));
  for (int a = 0; a < 3; ++a) {
    for (int b = 0; b < 3; ++b) {
      // Of what is not linear: a heading that is off by 0.04 rad.
      const double nonlinear = 0.01 * std::sqrt(expected(a, a) * expected(b, b));
      EXPECT_NEAR(sampled.covariance(a, b), expected(a, b),
                  kStandardErrors * covarianceError(expected, a, b, kSamples) + nonlinear)
          << a << ", " << b;
    }
  }
}

TEST(PoseGraph, TakesNoBiasAsOne) {
  Loop loop(2);
  loop.params.velocity_bias_std_mps = 0.0;
  loop.params.yaw_bias_std_radps = 0.0;
  loop.params.current_std_mps = 0.0;
  const SolvedGraph graph(loop.params, loop.given);
  EXPECT_LT(std::abs(graph.bias().surge_mps), 1e-9);
  EXPECT_LT(std::abs(graph.bias().yaw_radps), 1e-9);
  EXPECT_LT(std::abs(graph.bias().current_x_mps), 1e-9);
  SmoothingParams tiny = loop.params;
  tiny.velocity_bias_std_mps = 1e-6;
  tiny.yaw_bias_std_radps = 1e-8;
  tiny.current_std_mps = 1e-6;
  expectDense(graph, DenseGraph(tiny, loop.given));
}

// ---- closures ----------------------------------------------------------------------------------

TEST(PoseGraph, IsTheLeastSquaresSolution) {
  for (const std::uint32_t seed : {3U, 4U}) {
    Loop loop(seed);
    // Two closures are far off, at a place that the others tell otherwise.
    loop.given.closures[3].relative.pose.x_m += 3.0;
    loop.given.closures[9].relative.pose.yaw_rad += 0.2;
    const SolvedGraph graph(loop.params, loop.given);
    const DenseGraph dense(loop.params, loop.given);
    expectDense(graph, dense);
    for (std::size_t c = 0; c < loop.given.closures.size(); ++c) {
      EXPECT_NEAR(graph.weightOfClosure(c), dense.weightOfClosure(c), kSolved) << c;
    }
    EXPECT_LT(graph.weightOfClosure(3), 0.03);
    EXPECT_LT(graph.weightOfClosure(9), 0.03);
    EXPECT_GT(graph.weightOfClosure(4), 0.3);
    const Eigen::VectorXd expected = dense.biasAt(graph.size() - 1);
    EXPECT_NEAR(graph.bias().surge_mps, expected(0), kSolved * loop.params.velocity_bias_std_mps);
    EXPECT_NEAR(graph.bias().sway_mps, expected(1), kSolved * loop.params.velocity_bias_std_mps);
    EXPECT_NEAR(graph.bias().yaw_radps, expected(2), kSolved * loop.params.yaw_bias_std_radps);
    EXPECT_NEAR(graph.bias().current_x_mps, expected(3), kSolved * loop.params.current_std_mps);
    EXPECT_NEAR(graph.bias().current_y_mps, expected(4), kSolved * loop.params.current_std_mps);
    EXPECT_NEAR(graph.biasAt(10).surge_mps, dense.biasAt(10)(0),
                kSolved * loop.params.velocity_bias_std_mps);
  }
}

TEST(PoseGraph, HasTheDenseCovariancesOfRelativePoses) {
  const Loop loop(5);
  const SolvedGraph graph(loop.params, loop.given);
  for (const double share : {1.0, 0.4}) {
    const DenseGraph dense(loop.params, loop.given, share);
    const PoseGraph::Covariances covariances(graph, share);
    for (const auto& [k, j] :
         {std::pair<std::size_t, std::size_t>(0, 32), {3, 4}, {10, 64}, {0, 1}, {35, 20}}) {
      const Eigen::Matrix3d expected = dense.relativeCovariance(k, j);
      const Eigen::Vector3d inverse_std = expected.diagonal().cwiseSqrt().cwiseInverse();
      const Eigen::Matrix3d off = covariances.ofRelative(k, j) - expected;
      EXPECT_LT((inverse_std.asDiagonal() * off * inverse_std.asDiagonal()).cwiseAbs().maxCoeff(),
                kSolved)
          << k << ", " << j << ": closures count for " << share;
    }
    EXPECT_LT(covariances.ofRelative(7, 7).norm(), 1e-12) << "a node in its own frame";
  }
}

// Over some tracks, the errors are as large as their covariances have them.
TEST(PoseGraph, ErrsAboutAsMuchAsItSays) {
  constexpr int kTracks = 40;
  double sum = 0.0;
  double dead_reckoning2 = 0.0;
  double smoothed2 = 0.0;
  for (std::uint32_t seed = 0; seed < kTracks; ++seed) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    SmoothingParams params;
    Loop loop(100 + seed, {params.velocity_bias_std_mps * normal(random),
                           params.velocity_bias_std_mps * normal(random),
                           params.yaw_bias_std_radps * normal(random)});
    loop.params.start_position_std_m = 0.0;  // it is exact
    loop.params.start_yaw_std_rad = 0.0;
    const SolvedGraph graph(loop.params, loop.given);
    const std::vector<Pose2> dead_reckoning = loop.deadReckoning();
    const PoseGraph::Covariances covariances(graph);
    constexpr std::size_t kNode = 50;
    const Eigen::Vector3d error = difference(graph.pose(kNode), loop.truth[kNode]);
    sum += error.dot(covariances.of(kNode).ldlt().solve(error));
    smoothed2 += error.head<2>().squaredNorm();
    dead_reckoning2 += difference(dead_reckoning[kNode], loop.truth[kNode]).head<2>().squaredNorm();
  }
  // chi-squared of 3 per track: a mean of 3 with a standard error of sqrt(6 / 40) = 0.39; Cauchy's
  // kernel takes a quarter off the closures' information, 1 / (1 + 3 / 6) at most a third.
  EXPECT_GT(sum / kTracks, 1.5);
  EXPECT_LT(sum / kTracks, 4.2);
  EXPECT_LT(smoothed2, 0.5 * dead_reckoning2);
}

// Out on a line, and back on it at half the speed: at one speed a wrong surge or sway only makes
// the whole track larger or turns it, which no closure can tell.
TEST(PoseGraph, FindsBiasesWhereTheSpeedChanges) {
  const MotionBias bias{0.03, -0.02, 1e-4};
  SmoothingParams params;
  params.motion = {0.005, 0.005, 1e-4};
  params.current_std_mps = 0.0;
  PoseGraph graph(params, 0.0, {});
  std::vector<Pose2> truth{Pose2{}};
  for (std::size_t j = 1; j <= 120; ++j) {
    const double turn = j == 40 ? M_PI : 0.0;
    const double forward_m = j <= 40 ? 3.0 : 1.5;
    truth.push_back(compose(truth.back(), {forward_m, 0.0, turn}));
    // Measured halfway through the turn, as the biases are.
    const double c = std::cos(turn / 2.0);
    const double s = std::sin(turn / 2.0);
    graph.addNode(2.0 * static_cast<double>(j),
                  {forward_m + 2.0 * (c * bias.surge_mps - s * bias.sway_mps),
                   2.0 * (s * bias.surge_mps + c * bias.sway_mps), turn + 2.0 * bias.yaw_radps});
    if (j <= 40 || j % 2 != 0) continue;
    const std::size_t k = 40 - (j - 40) / 2;
    graph.addClosure(k, j, {relative(truth[k], truth[j]), diagonal(0.05, 0.003)});
  }
  graph.solve();
  // Known from 80 s of drift that is told to 0.1 m, 0.001 m/s, and with the biases' own change, of
  // 0.004 m/s in a minute.
  EXPECT_NEAR(graph.bias().surge_mps, bias.surge_mps, 0.006);
  EXPECT_NEAR(graph.bias().sway_mps, bias.sway_mps, 0.006);
  EXPECT_NEAR(graph.bias().yaw_radps, bias.yaw_radps, 2e-5);
  // Without its biases the track ends 3 m off.
  EXPECT_LT(difference(graph.pose(40), truth[40]).head<2>().norm(), 0.6);
  EXPECT_LT(difference(graph.pose(120), truth[120]).head<2>().norm(), 0.1);
}

TEST(PoseGraph, FindsBiasesAgainstFixes) {
  SmoothingParams params;
  params.current_std_mps = 0.0;
  const MotionBias bias{0.03, -0.02, 0.0};
  PoseGraph graph(params, 0.0, {});
  for (std::size_t i = 1; i <= 120; ++i) {
    graph.addNode(2.0 * static_cast<double>(i),
                  {3.0 + 2.0 * bias.surge_mps, 2.0 * bias.sway_mps, 0.0});
    if (i % 10 == 0) {
      graph.addFix(i, {3.0 * static_cast<double>(i), 0.0}, 0.01 * Eigen::Matrix2d::Identity());
    }
  }
  graph.solve();
  // From 240 s of 0.05 m/sqrt(s), 0.003 m/s; sway is told less well from a heading that wanders by
  // 0.015 rad, 0.02 m/s at this speed.
  EXPECT_NEAR(graph.bias().surge_mps, bias.surge_mps, 0.003);
  EXPECT_NEAR(graph.bias().sway_mps, bias.sway_mps, 0.008);
}

// A current keeps its direction where the vehicle turns, and a wrong velocity does not: out and
// back on a line, twice.
TEST(PoseGraph, TellsACurrentFromABias) {
  const MotionBias bias{0.02, 0.0, 0.0, 0.04, -0.03};
  const Eigen::Vector2d current_mps(bias.current_x_mps, bias.current_y_mps);
  SmoothingParams params;
  params.motion = {0.005, 0.005, 1e-4};
  PoseGraph graph(params, 0.0, {});
  std::vector<Pose2> truth{Pose2{}};
  for (std::size_t j = 1; j <= 160; ++j) {
    const double turn = j % 40 == 0 ? M_PI : 0.0;
    truth.push_back(compose(truth.back(), {3.0, 0.0, turn}));
    const Eigen::Vector2d flow = Eigen::Rotation2Dd(-truth[j - 1].yaw_rad) * (2.0 * current_mps);
    const double c = std::cos(turn / 2.0);
    const double s = std::sin(turn / 2.0);
    graph.addNode(2.0 * static_cast<double>(j), {3.0 + 2.0 * c * bias.surge_mps - flow.x(),
                                                 2.0 * s * bias.surge_mps - flow.y(), turn});
    if (j > 40 && j % 2 == 0) {
      const std::size_t line = (j - 1) / 40;
      const std::size_t k = 2 * 40 * line - j;  // where it was on the line before
      graph.addClosure(k, j, {relative(truth[k], truth[j]), diagonal(0.05, 0.003)});
    }
  }
  graph.solve();
  // In 320 s the current carries the track 16 m off; passes tell it to 0.05 m over the way there
  // and back, 0.001 m/s, and its own change in a minute is 0.0018 m/s.
  EXPECT_NEAR(graph.bias().current_x_mps, bias.current_x_mps, 0.006);
  EXPECT_NEAR(graph.bias().current_y_mps, bias.current_y_mps, 0.006);
  EXPECT_LT(difference(graph.pose(160), truth[160]).head<2>().norm(), 0.3);
}

TEST(PoseGraph, DoesNotMindWhereYawIsCut) {
  // The same loop, turned so that its headings cross +-pi elsewhere.
  Loop loop(7);
  const SolvedGraph graph(loop.params, loop.given);
  for (const double turn : {0.6416, 3.1, -2.0}) {  // the first one: 2.5 + 0.6416 is pi
    GivenTrack turned = loop.given;
    turned.start = compose({0.0, 0.0, turn}, loop.given.start);
    const SolvedGraph other(loop.params, turned);
    for (std::size_t i = 0; i < graph.size(); ++i) {
      const Pose2 back = compose({0.0, 0.0, -turn}, other.pose(i));
      EXPECT_LT(difference(back, graph.pose(i)).norm(), 2e-3) << turn << ", " << i;
      EXPECT_LE(std::abs(other.pose(i).yaw_rad), M_PI);
    }
  }
  // A closure across the cut.
  PoseGraph two(SmoothingParams{}, 0.0, {0.0, 0.0, M_PI - 0.001});
  two.addNode(10.0, {15.0, 0.0, 0.002});
  two.addClosure(0, 1, {{15.0, 0.0, 0.004 - 2.0 * M_PI}, diagonal(1.0, 0.001)});
  two.solve();
  EXPECT_NEAR(two.pose(1).yaw_rad, -M_PI + 0.002, 0.0012);
}

TEST(PoseGraph, FollowsFixesButNotThoseFarOff) {
  Loop loop(8);
  loop.given.closures.clear();
  std::mt19937 random(9);
  std::normal_distribution<double> normal;
  const Eigen::Matrix2d covariance = (Eigen::Matrix2d() << 1.0, 0.3, 0.3, 0.5).finished();
  for (std::size_t i = 8; i < loop.truth.size(); i += 8) {
    const Eigen::Vector2d error =
        covariance.llt().matrixL() * Eigen::Vector2d(normal(random), normal(random));
    loop.given.fixes.push_back(
        {i, Eigen::Vector2d(loop.truth[i].x_m, loop.truth[i].y_m) + 0.3 * error, covariance});
  }
  loop.given.fixes[4].position_m.x() += 30.0;
  const SolvedGraph graph(loop.params, loop.given);
  const DenseGraph dense(loop.params, loop.given);
  expectDense(graph, dense);
  for (std::size_t f = 0; f < loop.given.fixes.size(); ++f) {
    EXPECT_NEAR(graph.weightOfFix(f), dense.weightOfFix(f), kSolved) << f;
    if (f == 4) {
      EXPECT_LT(graph.weightOfFix(f), 0.02);
    } else {
      EXPECT_GT(graph.weightOfFix(f), 0.5) << f;
    }
  }
  const std::size_t last = graph.size() - 1;
  GivenTrack without = loop.given;
  without.fixes.clear();
  const SolvedGraph blind(loop.params, without);
  EXPECT_LT(difference(graph.pose(last), loop.truth[last]).head<2>().norm(), 1.0);
  const Eigen::Matrix3d known = PoseGraph::Covariances(graph).of(last);
  EXPECT_LT(known(0, 0), covariance(0, 0));
  EXPECT_LT(known(0, 0), PoseGraph::Covariances(blind).of(last)(0, 0));
}

// ---- growing -----------------------------------------------------------------------------------

TEST(PoseGraph, GrowsToTheSolutionOfAllAtOnce) {
  const Loop loop(10);
  PoseGraph graph(loop.params, loop.given.stamps_s.front(), loop.given.start);
  std::size_t closure = 0;
  for (std::size_t i = 0; i < loop.given.moved.size(); ++i) {
    graph.addNode(loop.given.stamps_s[i + 1], loop.given.moved[i]);
    while (closure < loop.given.closures.size() && loop.given.closures[closure].j == i + 1) {
      const GivenClosure& c = loop.given.closures[closure];
      EXPECT_EQ(graph.addClosure(c.k, c.j, c.relative), closure);
      ++closure;
      graph.solve();
    }
  }
  ASSERT_EQ(closure, loop.given.closures.size());
  expectDense(graph, DenseGraph(loop.params, loop.given));

  graph.clearClosures();
  graph.solve();
  const std::vector<Pose2> dead_reckoning = loop.deadReckoning();
  for (std::size_t i = 0; i < graph.size(); i += 8) {
    EXPECT_LT(difference(graph.pose(i), dead_reckoning[i]).norm(), 1e-3) << i;
  }
  for (const GivenClosure& c : loop.given.closures) graph.addClosure(c.k, c.j, c.relative);
  graph.solve();
  expectDense(graph, DenseGraph(loop.params, loop.given));
}

// The odometry goes on without what is known of its bias.
TEST(PoseGraph, GoesOnWithoutItsBias) {
  const Loop loop(11, {0.03, -0.02, 1e-4}, 0.1);
  SolvedGraph graph(loop.params, loop.given);
  const MotionBias bias = graph.bias();
  const Pose2 last = graph.pose(graph.size() - 1);
  graph.addNode(loop.given.stamps_s.back() + 4.0, {6.0, 0.0, 0.0});
  Pose2 expected =
      compose(last, {6.0 - 4.0 * bias.surge_mps, -4.0 * bias.sway_mps, -4.0 * bias.yaw_radps});
  expected.x_m += 4.0 * bias.current_x_mps;
  expected.y_m += 4.0 * bias.current_y_mps;
  EXPECT_LT(difference(graph.pose(graph.size() - 1), expected).norm(), 1e-9);
}

// ---- what is refused ---------------------------------------------------------------------------

TEST(PoseGraphParams, OutOfRangeAreRefusedByName) {
  const auto expectRefused = [](double SmoothingParams::*param, double value, const char* name) {
    SmoothingParams params;
    params.*param = value;
    try {
      PoseGraph(params, 0.0, {});
      ADD_FAILURE() << name << " of " << value << " is taken";
    } catch (const std::invalid_argument& error) {
      EXPECT_NE(std::string(error.what()).find(name), std::string::npos) << error.what();
    }
  };
  for (const double bad : {-1e-9, kNaN, std::numeric_limits<double>::infinity()}) {
    expectRefused(&SmoothingParams::velocity_bias_std_mps, bad, "velocity_bias_std_mps");
    expectRefused(&SmoothingParams::yaw_bias_std_radps, bad, "yaw_bias_std_radps");
    expectRefused(&SmoothingParams::current_std_mps, bad, "current_std_mps");
    expectRefused(&SmoothingParams::bias_time_s, bad, "bias_time_s");
    expectRefused(&SmoothingParams::start_position_std_m, bad, "start_position_std_m");
    expectRefused(&SmoothingParams::start_yaw_std_rad, bad, "start_yaw_std_rad");
  }
  expectRefused(&SmoothingParams::bias_time_s, 0.5, "bias_time_s");
}

TEST(PoseGraphNodes, DoNotGoBackInTime) {
  PoseGraph graph(SmoothingParams{}, 10.0, {});
  EXPECT_THROW(graph.addNode(9.9, {}), std::invalid_argument);
  EXPECT_THROW(graph.addNode(kNaN, {}), std::invalid_argument);
  EXPECT_EQ(graph.size(), 1U);
  graph.addNode(10.0, {});                  // at the same time
  graph.addNode(500.0, {100.0, 0.0, 0.0});  // after a gap
  graph.solve();
  EXPECT_NEAR(graph.pose(2).x_m, 100.0, 1e-6);
}

TEST(PoseGraphClosures, ThatCannotBeWeighedAreRefused) {
  PoseGraph graph(SmoothingParams{}, 0.0, {});
  graph.addNode(2.0, {3.0, 0.0, 0.0});
  EXPECT_THROW(graph.addClosure(1, 1, {{}, diagonal(0.1, 0.01)}), std::invalid_argument);
  EXPECT_THROW(graph.addClosure(0, 1, {{}, diagonal(0.1, 0.0)}), std::invalid_argument);
  EXPECT_THROW(graph.addClosure(0, 1, {{}, diagonal(kNaN, 0.01)}), std::invalid_argument);
  EXPECT_THROW(graph.addClosure(0, 2, {{}, diagonal(0.1, 0.01)}), std::out_of_range);
  EXPECT_THROW(graph.addFix(1, {0.0, 0.0}, Eigen::Matrix2d::Zero()), std::invalid_argument);
  EXPECT_THROW(graph.addFix(2, {0.0, 0.0}, Eigen::Matrix2d::Identity()), std::out_of_range);
  EXPECT_EQ(graph.addClosure(0, 1, {{3.0, 0.0, 0.0}, diagonal(0.1, 0.01)}), 0U);
  graph.solve();
  EXPECT_NEAR(graph.pose(1).x_m, 3.0, 1e-9);
}

}  // namespace
}  // namespace rbpf_core::smoothing
