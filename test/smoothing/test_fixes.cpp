// Absolute fixes in the graph, and on their way there from a running filter.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "rbpf_core/rigid.hpp"
#include "rbpf_core/smoothing/past_smoothing.hpp"
#include "survey.hpp"

namespace rbpf_core::smoothing {
namespace {

FixRecord recordAt(double stamp_s, const Eigen::Vector2d& position_m, const Pose2& dead_reckoning,
                   double std_m = 0.5) {
  return {{stamp_s, position_m, std_m * std_m * Eigen::Matrix2d::Identity()}, dead_reckoning};
}

// ---- the graph ---------------------------------------------------------------------------------

TEST(PoseGraphFixes, TellOfAPointInTheNodesFrame) {
  SmoothingParams params;
  params.start_position_std_m = 5.0;
  params.start_yaw_std_rad = 0.5;
  PoseGraph graph(params, 0.0, {});
  // two points of one rigid body: place and heading
  const Pose2 truth{3.0, -2.0, 0.3};
  for (const Eigen::Vector2d& lever : {Eigen::Vector2d(10.0, 1.0), Eigen::Vector2d(-10.0, 2.0)}) {
    const Pose2 at = compose(truth, {lever.x(), lever.y(), 0.0});
    graph.addFix(0, {at.x_m, at.y_m}, 1e-4 * Eigen::Matrix2d::Identity(), lever);
  }
  graph.solve();
  // of the prior (5 m, 0.5 rad) is left what 1 cm and 1 mrad leave of it
  EXPECT_NEAR(graph.pose(0).x_m, truth.x_m, 1e-3);
  EXPECT_NEAR(graph.pose(0).y_m, truth.y_m, 1e-3);
  EXPECT_NEAR(graph.pose(0).yaw_rad, truth.yaw_rad, 1e-4);
}

TEST(PoseGraphFixes, AreBelievedHoweverFarOffIfTheyMayNotBeWrong) {
  SmoothingParams params;
  params.start_position_std_m = 1.0;
  params.start_yaw_std_rad = 0.5;
  PoseGraph graph(params, 0.0, {});
  graph.addFix(0, {10.0, 0.0}, Eigen::Matrix2d::Identity(), Eigen::Vector2d::Zero(), false);
  graph.addHeading(0, 1.0, 0.25);
  graph.solve();
  // halfway: both are as sure
  EXPECT_NEAR(graph.pose(0).x_m, 5.0, 1e-3);
  EXPECT_NEAR(graph.pose(0).yaw_rad, 0.5, 1e-4);
  EXPECT_EQ(graph.weightOfFix(0), 1.0);
}

// ---- the smoother ------------------------------------------------------------------------------

// A straight line over a seabed that tells nothing, with dead reckoning 1 % too slow.
class SmootherFixes : public testing::Test {
 protected:
  static constexpr double kSpeed = 1.5;

  static Pose2 truth(double stamp_s) { return {kSpeed * stamp_s, 0.0, 0.0}; }
  static Pose2 deadReckoning(double stamp_s) { return {0.99 * kSpeed * stamp_s, 0.0, 0.0}; }
  FixRecord fix(double stamp_s, const Eigen::Vector2d& error_m = Eigen::Vector2d::Zero()) const {
    const Pose2 at = truth(stamp_s);
    return recordAt(stamp_s, Eigen::Vector2d(at.x_m, at.y_m) + error_m, deadReckoning(stamp_s));
  }
  void sail(double from_s, double to_s) {
    Beams beams = Beams::Zero(3, 20);
    beams.row(1).setLinSpaced(20, -10.0F, 10.0F);
    beams.row(2).setConstant(-20.0F);
    for (double stamp_s = from_s; stamp_s < to_s; stamp_s += 0.5) {
      smoother.addPing(stamp_s, deadReckoning(stamp_s), beams);
    }
  }
  Eigen::Vector2d errorAtEnd() const {
    const Pose2 pose = smoother.posesOfPings().back();
    const Pose2 there = truth(smoother.track().pings().back().stamp_s);
    return {pose.x_m - there.x_m, pose.y_m - there.y_m};
  }

  Smoother smoother{SmoothingParams{}, 0.0, {}};
};

TEST_F(SmootherFixes, PullTheTrackWithoutAnyClosure) {
  sail(0.0, 400.0);
  const std::size_t nodes = smoother.track().nodes().size();
  for (double stamp_s = 390.3; stamp_s < 399.0; stamp_s += 1.0) smoother.addFix(fix(stamp_s));
  EXPECT_EQ(smoother.track().nodes().size(), nodes);  // they belong to those that are there
  EXPECT_TRUE(smoother.knowsMore());
  EXPECT_NEAR(errorAtEnd().x(), -6.0, 0.1);
  smoother.update();
  // nine fixes of 0.5 m
  EXPECT_LT(errorAtEnd().norm(), 0.3);
  smoother.registerAgain();
  EXPECT_LT(errorAtEnd().norm(), 0.3);
}

TEST_F(SmootherFixes, ThatAreOutliersAreWeighedDown) {
  sail(0.0, 400.0);
  for (double stamp_s = 300.3; stamp_s < 399.0; stamp_s += 10.0) smoother.addFix(fix(stamp_s));
  smoother.addFix(fix(395.0, {0.0, 50.0}));
  smoother.update();
  EXPECT_LT(errorAtEnd().norm(), 0.5);
  EXPECT_GT(smoother.graph().weightOfFix(0), 0.8);
  EXPECT_LT(smoother.graph().weightOfFix(10), 0.01);
}

TEST_F(SmootherFixes, AtASurfacingGetPlacesOfTheirOwn) {
  sail(0.0, 200.0);
  const std::size_t nodes = smoother.track().nodes().size();
  for (int s = 300; s < 330; ++s) smoother.addFix(fix(s));
  EXPECT_GE(smoother.track().nodes().size(), nodes + 9);  // a node every two to three seconds
  sail(400.0, 500.0);
  smoother.addFix(fix(250.0));  // and one comes late
  smoother.finishPings();
  smoother.update();
  EXPECT_EQ(smoother.posesOfPings().size(), 600U);
  EXPECT_LT(errorAtEnd().norm(), 2.0);  // 1.7 m of drift since, less what the bias takes off
  smoother.registerAgain();
  EXPECT_LT(errorAtEnd().norm(), 2.0);
}

TEST_F(SmootherFixes, LeaveRoomForPingsThatComeLate) {
  sail(0.0, 100.0);
  smoother.addFix(fix(110.0));
  sail(109.5, 120.0);
  smoother.finishPings();
  smoother.update();
  EXPECT_LT(errorAtEnd().norm(), 1.0);
}

// ---- from the filter ---------------------------------------------------------------------------

TEST(PastSmoothingFixes, CorrectTheFiltersPastAtTheSurveysEnd) {
  FilterParams params;
  params.particles = 10;
  params.holdout = 0.0;
  ParticleFilter filter(params);
  PastSmoothing smoothing(filter, {});
  const auto odometry = [](double stamp_s) {
    Odometry one;
    one.stamp_s = stamp_s;
    one.pose = {0.99 * 1.5 * stamp_s, 0.0, 0.0};
    one.linear_mps = {0.99 * 1.5, 0.0, 0.0};
    return one;
  };
  Ping ping;
  ping.beams_m = Beams::Zero(3, 20);
  ping.beams_m.row(1).setLinSpaced(20, -10.0F, 10.0F);
  ping.beams_m.row(2).setConstant(-20.0F);
  for (int k = 0; k <= 800; ++k) {
    filter.addOdometry(odometry(0.5 * k));
    ping.stamp_s = 0.5 * k;
    if (k < 780) filter.addPing(ping);  // and then it surfaces
  }
  EXPECT_FALSE(smoothing.smooth().correction.has_value());
  for (double stamp_s = 392.0; stamp_s < 400.0; stamp_s += 1.0) {
    filter.addFix({stamp_s, {1.5 * stamp_s, 0.0}, 0.25 * Eigen::Matrix2d::Identity()});
  }
  EXPECT_FALSE(smoothing.smooth().correction.has_value());  // pings might still come
  const PastSmoothing::News news = smoothing.finish();
  EXPECT_EQ(smoothing.result()->fixes, 8U);
  ASSERT_TRUE(news.correction.has_value());
  filter.correctPast(*news.correction);
  const FilterSnapshot after = filter.snapshot();
  const Pose2 last = after.pastAt(after.pings() - 1, after.logWeights().exp()).mean;
  EXPECT_NEAR(last.x_m, 1.5 * 389.5, 0.5);  // was 5.8 m behind
}

// 40 m off to the side and turned by 0.2 rad, and surer than 400 s of odometry.
TEST(PastSmoothingGivenPose, KeepsParticlesWhereTheyWereDrawnAndMovesThePast) {
  FilterParams params;
  params.particles = 50;
  params.holdout = 0.0;
  params.start_position_std_m = 30.0;
  params.start_yaw_std_rad = 0.3;
  ParticleFilter filter(params);
  PastSmoothing smoothing(filter, {});
  Ping ping;
  ping.beams_m = Beams::Zero(3, 20);
  ping.beams_m.row(1).setLinSpaced(20, -10.0F, 10.0F);
  ping.beams_m.row(2).setConstant(-20.0F);
  const auto sailTo = [&](double until_s) {
    const auto now = filter.snapshot().estimate();
    for (double stamp_s = now.stamp_s; stamp_s <= until_s; stamp_s += 0.5) {
      Odometry odometry;
      odometry.stamp_s = stamp_s;
      odometry.pose = {1.5 * stamp_s, 0.0, 0.0};
      odometry.linear_mps = {1.5, 0.0, 0.0};
      if (stamp_s > now.stamp_s || stamp_s == 0.0) filter.addOdometry(odometry);
      ping.stamp_s = stamp_s;
      if (stamp_s > now.stamp_s) filter.addPing(ping);
    }
  };
  sailTo(100.0);
  const auto offTheTruth = [&](const Pose2& pose, double stamp_s) {
    const Pose2 at_fix{150.0, 40.0, 0.2};
    const Pose2 there = compose(at_fix, {1.5 * (stamp_s - 100.0), 0.0, 0.0});
    return std::hypot(pose.x_m - there.x_m, pose.y_m - there.y_m);
  };
  filter.addFix({100.0, {150.0, 40.0}, 0.01 * Eigen::Matrix2d::Identity(), Heading{0.2, 1e-4}});
  for (const auto& [fix, particles] : filter.takeFixesToWeigh()) {
    filter.drawAnew(fix, particles->poses);
  }
  // the mean of 50 of 0.1 m, 0.01 rad; and then by the graph, with its own start and odometry
  EXPECT_LT(offTheTruth(filter.snapshot().estimate().mean, 100.0), 0.1);
  for (const double until_s : {100.0, 110.0}) {
    sailTo(until_s);
    const PastSmoothing::News news = smoothing.smooth();
    if (news.correction) filter.correctPast(*news.correction);  // or both agree already
    EXPECT_LT(offTheTruth(filter.snapshot().estimate().mean, until_s), 1.0);
  }
  const FilterSnapshot after = filter.snapshot();
  const Pose2 first = after.pastAt(0, after.logWeights().exp()).mean;
  // over 100 s of odometry, 0.5 m and 0.01 rad of 150 m
  EXPECT_LT(offTheTruth(first, after.record(0).stamp_s), 5.0);
}

}  // namespace
}  // namespace rbpf_core::smoothing
