// Motion taken from the odometry's pose: for want of a twist, as it was wished, and over long gaps.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "rbpf_core/particle_filter.hpp"
#include "statistics.hpp"
#include "survey.hpp"

namespace rbpf_core {
namespace {

// A figure of eight in closed form: pose and twist agree.
Odometry eight(double stamp_s) {
  Odometry odometry;
  odometry.stamp_s = stamp_s;
  const double w = 0.05;
  const Eigen::Vector2d v_mps(40.0 * w * std::cos(w * stamp_s),
                              40.0 * w * std::cos(2.0 * w * stamp_s));
  const Eigen::Vector2d a(-40.0 * w * w * std::sin(w * stamp_s),
                          -80.0 * w * w * std::sin(2.0 * w * stamp_s));
  odometry.pose = {40.0 * std::sin(w * stamp_s), 20.0 * std::sin(2.0 * w * stamp_s),
                   std::atan2(v_mps.y(), v_mps.x())};
  odometry.attitude = {-10.0, 0.1, -0.05};
  const double yaw_rate = (v_mps.x() * a.y() - v_mps.y() * a.x()) / v_mps.squaredNorm();
  const Eigen::Matrix3d level = levelRotation(0.1, -0.05);
  odometry.linear_mps = level.transpose() * Eigen::Vector3d(v_mps.norm(), 0.0, 0.0);
  odometry.angular_radps = level.transpose() * Eigen::Vector3d(0.0, 0.0, yaw_rate);
  return odometry;
}

Odometry withoutTwist(Odometry odometry) {
  odometry.linear_mps.setZero();
  odometry.angular_radps.setZero();
  return odometry;
}

FilterParams with(Velocity velocity) {
  FilterParams params = quietParams();
  params.odometry.velocity = velocity;
  return params;
}

// ---- increments --------------------------------------------------------------------------------

TEST(MotionOfPoses, LeadsFromOnePoseExactlyToTheOther) {
  RandomStream stream(3);
  const auto anywhere = [&](double stamp_s) {
    Odometry odometry;
    odometry.stamp_s = stamp_s;
    odometry.pose = {500000.0 + 100.0 * stream.uniform(), -60.0 + 100.0 * stream.uniform(),
                     wrapAngle(2.0 * M_PI * stream.uniform())};
    return odometry;
  };
  for (int i = 0; i < 200; ++i) {
    const Odometry from = anywhere(1.0);
    const Odometry to = anywhere(3.0);
    const MotionIncrement motion = motionOfPoses(from, to);
    EXPECT_EQ(motion.duration_s, 2.0);
    EXPECT_LE(std::abs(motion.yaw_rad), M_PI);
    expectNear(advance(from.pose, motion), to.pose, 1e-9);  // rounding at 500 km
  }
}

TEST(MotionOfPoses, TurnsTheShorterWayAcrossPlusMinusPi) {
  Odometry from = straight(0.0);
  Odometry to = straight(1.0);
  from.pose = {0.0, 0.0, M_PI - 0.1};
  to.pose = {-1.0, 0.0, -M_PI + 0.1};
  const MotionIncrement motion = motionOfPoses(from, to);
  EXPECT_NEAR(motion.yaw_rad, 0.2, 1e-12);
  EXPECT_NEAR(motion.forward_m, 1.0, 1e-12);  // backwards along x, heading there
  EXPECT_NEAR(motion.left_m, 0.0, 1e-12);
}

TEST(MotionOfPoses, EqualsTheTwistsWhereBothAreRight) {
  for (double t = 0.0; t < 120.0; t += 0.1) {
    const MotionIncrement pose = motionOfPoses(eight(t), eight(t + 0.1));
    const MotionIncrement twist = motionBetween(eight(t), eight(t + 0.1));
    // (dt)^2 / 12 of second derivatives of order w^2 v
    EXPECT_NEAR(pose.forward_m, twist.forward_m, 1e-5);
    EXPECT_NEAR(pose.left_m, twist.left_m, 1e-5);
    EXPECT_NEAR(pose.yaw_rad, twist.yaw_rad, 1e-5);
  }
}

TEST(MotionOfPoses, RefusesStampsThatDoNotIncrease) {
  EXPECT_THROW(motionOfPoses(straight(1.0), straight(1.0)), std::invalid_argument);
  EXPECT_THROW(motionOfPoses(straight(1.0), straight(0.9)), std::invalid_argument);
}

TEST(MotionSource, IsThePoseOnlyWhereBothTwistsAreEmpty) {
  const Odometry a = eight(1.0);
  const Odometry b = eight(1.1);
  const Odometry empty_a = withoutTwist(a);
  const Odometry empty_b = withoutTwist(b);
  const auto source = [](const Odometry& from, const Odometry& to, Velocity velocity) {
    return motionSource(from, to, {velocity});
  };
  EXPECT_EQ(source(a, b, Velocity::kAuto), MotionSource::kTwist);
  EXPECT_EQ(source(empty_a, b, Velocity::kAuto), MotionSource::kTwist);
  EXPECT_EQ(source(a, empty_b, Velocity::kAuto), MotionSource::kTwist);
  EXPECT_EQ(source(empty_a, empty_b, Velocity::kAuto), MotionSource::kPose);
  EXPECT_EQ(source(empty_a, empty_b, Velocity::kTwist), MotionSource::kTwist);
  EXPECT_EQ(source(a, b, Velocity::kPose), MotionSource::kPose);
  for (int i = 0; i < 6; ++i) {  // one number that is not zero is a twist
    Odometry almost = empty_b;
    (i < 3 ? almost.linear_mps(i) : almost.angular_radps(i - 3)) = 1e-300;
    EXPECT_EQ(source(empty_a, almost, Velocity::kAuto), MotionSource::kTwist);
  }
}

TEST(MotionSource, IsThePoseOverALongGapWhateverIsWished) {
  for (const Velocity velocity : {Velocity::kTwist, Velocity::kPose, Velocity::kAuto}) {
    EXPECT_EQ(motionSource(eight(1.0), eight(11.5), {velocity, 2.0, 10.0}),
              MotionSource::kPoseOverLongGap);
    EXPECT_NE(motionSource(eight(1.0), eight(11.0), {velocity, 2.0, 10.0}),
              MotionSource::kPoseOverLongGap);
  }
}

// ---- odometry/velocity -------------------------------------------------------------------------

TEST(VelocityOfTheFilter, ByPoseFollowsThePoseWhateverTheTwist) {
  ParticleFilter filter(with(Velocity::kPose));
  for (int k = 0; k <= 600; ++k) {
    Odometry odometry = eight(0.2 * k);
    odometry.linear_mps *= 1.9;
    odometry.angular_radps *= 57.3;
    filter.addOdometry(odometry);
  }
  for (const Pose2& pose : filter.snapshot().particles()) expectNear(pose, eight(120).pose, 1e-9);
  const FilterSnapshot snapshot = filter.snapshot();
  EXPECT_EQ(snapshot.odometryUse().source(), MotionSource::kPose);
  EXPECT_EQ(snapshot.odometryUse().intervalsByPose(), 600U);
}

TEST(VelocityOfTheFilter, IsFoundOutByItselfForEmptyTwists) {
  ParticleFilter filter(with(Velocity::kAuto));
  FilterParams elsewhere = with(Velocity::kAuto);
  elsewhere.start_pose = Pose2{100.0, 0.0, eight(0.0).pose.yaw_rad + M_PI / 2.0};
  ParticleFilter turned(elsewhere);
  for (int k = 0; k <= 600; ++k) {
    filter.addOdometry(withoutTwist(eight(0.2 * k)));
    turned.addOdometry(withoutTwist(eight(0.2 * k)));
  }
  const Pose2 end = eight(120.0).pose;
  expectNear(filter.snapshot().particles()[0], end, 1e-9);
  // every particle in its own heading
  expectNear(turned.snapshot().particles()[0], {100.0 - end.y_m, end.x_m, end.yaw_rad + M_PI / 2.0},
             1e-9);
  EXPECT_EQ(filter.snapshot().odometryUse().byPoseSince(), 0.0);
}

TEST(VelocityOfTheFilter, ByTwistStandsStillWithEmptyTwists) {
  ParticleFilter filter(with(Velocity::kTwist));
  for (int k = 0; k <= 100; ++k) filter.addOdometry(withoutTwist(eight(0.2 * k)));
  EXPECT_EQ(filter.snapshot().particles()[0], eight(0.0).pose);
  EXPECT_EQ(filter.snapshot().odometryUse().intervalsByPose(), 0U);
}

TEST(VelocityOfTheFilter, TellsOfThePoseOnlyWhereItMattered) {
  ParticleFilter filter(with(Velocity::kAuto));
  // a vehicle at rest has an empty twist and says nothing of its driver
  for (int k = 0; k < 10; ++k) {
    Odometry resting = withoutTwist(eight(0.0));
    resting.stamp_s = 0.2 * (k - 10);
    filter.addOdometry(resting);
  }
  EXPECT_EQ(filter.snapshot().odometryUse().source(), MotionSource::kTwist);
  EXPECT_EQ(filter.snapshot().odometryUse().byPoseSince(), std::nullopt);
  for (int k = 0; k < 10; ++k) filter.addOdometry(eight(0.2 * k));
  for (int k = 10; k < 15; ++k) filter.addOdometry(withoutTwist(eight(0.2 * k)));
  EXPECT_EQ(filter.snapshot().odometryUse().source(), MotionSource::kPose);
  EXPECT_EQ(filter.snapshot().odometryUse().intervalsByPose(), 4U);
  EXPECT_DOUBLE_EQ(filter.snapshot().odometryUse().byPoseSince().value(), 2.0);
  filter.addOdometry(eight(3.0));
  EXPECT_EQ(filter.snapshot().odometryUse().source(), MotionSource::kTwist);
}

TEST(VelocityOfTheFilter, FoundOutLeavesAGoodTwistAsItIs) {
  ParticleFilter by_itself(noisyParams());
  FilterParams params = noisyParams();
  params.odometry.velocity = Velocity::kTwist;
  ParticleFilter by_twist(params);
  sail(by_itself, turning, 0, 30);
  sail(by_twist, turning, 0, 30);
  EXPECT_EQ(by_itself.snapshot().particles(), by_twist.snapshot().particles());
}

// ---- gaps --------------------------------------------------------------------------------------

TEST(LongGap, IsCrossedByThePosesDifferenceInEachParticlesHeading) {
  FilterParams params = quietParams();
  params.start_pose = Pose2{0.0, 0.0, M_PI / 2.0};  // the odometry heads along x
  ParticleFilter filter(params);
  filter.addOdometry(straight(0.0));
  filter.addOdometry(straight(1.0));
  Odometry after = straight(3601.0);
  after.pose = {102.0, 30.0, 1.0};  // two metres a second would have led 7 km away
  filter.addOdometry(after);
  const Pose2 expected{-30.0, 102.0, 1.0 + M_PI / 2.0};
  for (const Pose2& pose : filter.snapshot().particles()) expectNear(pose, expected, 1e-9);
  expectNear(filter.snapshot().estimate().dead_reckoning, expected, 1e-9);
}

TEST(LongGap, HasNoiseForItsWholeDuration) {
  constexpr Eigen::Index kParticles = 4000;
  FilterParams params = quietParams(static_cast<std::size_t>(kParticles));
  params.motion = {0.05, 0.1, 0.0};
  ParticleFilter filter(params);
  filter.addOdometry(straight(0.0));
  filter.addOdometry(straight(400.0));
  Eigen::MatrixXd samples(kParticles, 2);
  const std::vector<Pose2> particles = filter.snapshot().particles();
  for (Eigen::Index j = 0; j < kParticles; ++j) {
    const Pose2& pose = particles[static_cast<std::size_t>(j)];
    samples.row(j) << pose.x_m - 800.0, pose.y_m;
  }
  const Moments seen = momentsOf(samples);
  const Eigen::Matrix2d expected = Eigen::Vector2d(1.0, 4.0).asDiagonal();  // 0.05^2, 0.1^2 x 400 s
  for (Eigen::Index a = 0; a < 2; ++a) {
    EXPECT_NEAR(seen.mean(a), 0.0, kStandardErrors * std::sqrt(expected(a, a) / kParticles));
    EXPECT_NEAR(seen.covariance(a, a), expected(a, a),
                kStandardErrors * covarianceError(expected, a, a, kParticles));
  }
}

TEST(LongGap, HoldsNoPingButAtItsEnds) {
  ParticleFilter filter(quietParams());
  filter.addOdometry(straight(0.0));
  filter.addOdometry(straight(1.0));
  for (const double stamp_s : {1.0, 1.5, 31.0, 60.9, 61.0}) filter.addPing(pingAt(stamp_s));
  filter.addOdometry(straight(61.0));
  EXPECT_NE(problemWith(filter, pingAt(60.0)).find("no odometry from 1.000 to 61.000 s"),
            std::string::npos);
  EXPECT_EQ(problemWith(filter, pingAt(61.0)), "");
  EXPECT_EQ(filter.snapshot().pings(), 3U);
  EXPECT_EQ(filter.snapshot().counters().pings_dropped, 4U);
  const FilterSnapshot snapshot = filter.snapshot();
  const auto& in_gap = snapshot.refused().counts().at({InputKind::kPing, Reason::kInGap});
  EXPECT_EQ(in_gap.messages, 4U);
  EXPECT_NE(in_gap.example.find("1.500"), std::string::npos);
}

TEST(ShortGap, IsBridgedWithTheTwistAndItsPingsTakenIn) {
  ParticleFilter filter(quietParams());
  filter.addOdometry(straight(0.0));
  Odometry after = straight(10.0);
  after.pose = {-500.0, 0.0, 0.0};  // not looked at
  filter.addOdometry(after);
  EXPECT_EQ(problemWith(filter, pingAt(5.0)), "");
  expectNear(filter.snapshot().particles()[0], {20.0, 0.0, 0.0}, 1e-9);
  EXPECT_EQ(filter.snapshot().odometryUse().gaps(), 1U);
  EXPECT_EQ(filter.snapshot().odometryUse().longGaps(), 0U);
}

// ---- survey time -------------------------------------------------------------------------------

TEST(SurveyTime, IsTheStampsOwnWithoutGaps) {
  ParticleFilter filter(quietParams());
  EXPECT_EQ(filter.snapshot().odometryUse().surveySeconds(), 0.0);
  EXPECT_EQ(filter.snapshot().odometryUse().unsurveyedSeconds(1e9), 0.0);
  for (int k = 0; k <= 50; ++k) filter.addOdometry(straight(1e9 + 2.0 * k));
  EXPECT_EQ(filter.snapshot().odometryUse().surveySeconds(), 100.0);
  EXPECT_EQ(filter.snapshot().odometryUse().unsurveyedSeconds(1e9 + 102.0), 0.0);
  EXPECT_EQ(filter.snapshot().odometryUse().gaps(), 0U);
}

TEST(SurveyTime, StandsStillInGapsAndNeverRunsBackwards) {
  ParticleFilter filter(quietParams());
  const std::vector<double> odometry_s = {0, 1, 2, 3602, 3603, 3610, 3611};
  double before_s = 0.0;
  std::size_t next = 0;
  for (double stamp_s = 0.0; stamp_s <= 3611.0; stamp_s += 0.5) {
    if (next < odometry_s.size() && odometry_s[next] <= stamp_s) {
      filter.addOdometry(straight(odometry_s[next++]));
    }
    const double now_s = stamp_s - filter.snapshot().odometryUse().unsurveyedSeconds(stamp_s);
    EXPECT_GE(now_s, before_s);
    EXPECT_LE(now_s, before_s + 0.5 + 1e-9);
    before_s = now_s;
  }
  const OdometryUse use = filter.snapshot().odometryUse();
  EXPECT_DOUBLE_EQ(use.surveySeconds(), 2 + 2 + 1 + 2 + 1);  // two seconds of either gap
  EXPECT_EQ(use.gaps(), 2U);
  EXPECT_EQ(use.longGaps(), 1U);
  EXPECT_DOUBLE_EQ(use.longestGapSeconds(), 3600.0);
}

}  // namespace
}  // namespace rbpf_core
