#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "rbpf_core/motion_model.hpp"

namespace rbpf_core {
namespace {

Odometry odometryAt(double stamp_s, const Eigen::Vector3d& linear_mps,
                    const Eigen::Vector3d& angular_radps, const Attitude& attitude = {}) {
  return {stamp_s, {}, attitude, linear_mps, angular_radps};
}

// Dead reckoning over messages of one and the same twist at a given rate.
Pose2 deadReckon(Pose2 pose, const Odometry& steady, double duration_s, double rate_hz) {
  Odometry from = steady;
  for (int k = 1; k <= std::lround(duration_s * rate_hz); ++k) {
    Odometry to = steady;
    to.stamp_s = steady.stamp_s + k / rate_hz;
    pose = advance(pose, motionBetween(from, to));
    from = to;
  }
  return pose;
}

// ---- dead reckoning ------------------------------------------------------------------------

TEST(DeadReckoning, StraightLineMeetsItsClosedForm) {
  const Odometry steady = odometryAt(100.0, {2.0, 0.5, 0.0}, Eigen::Vector3d::Zero());
  const double yaw = 0.7;
  const Pose2 end = deadReckon({10.0, -20.0, yaw}, steady, 50.0, 10.0);
  // 1e-9 m: 500 additions of about 100 m in double
  EXPECT_NEAR(end.x_m, 10.0 + 50.0 * (2.0 * std::cos(yaw) - 0.5 * std::sin(yaw)), 1e-9);
  EXPECT_NEAR(end.y_m, -20.0 + 50.0 * (2.0 * std::sin(yaw) + 0.5 * std::cos(yaw)), 1e-9);
  EXPECT_NEAR(end.yaw_rad, yaw, 1e-12);
}

TEST(DeadReckoning, CircleMeetsItsClosedFormAtEveryRate) {
  const double speed = 1.5;
  const double rate = 0.05;  // rad/s, a circle of 30 m radius
  const double radius = speed / rate;
  for (const double rate_hz : {5.0, 20.0, 100.0}) {
    const Odometry steady = odometryAt(0.0, {speed, 0.0, 0.0}, {0.0, 0.0, rate});
    const double duration = 40.0;
    const Pose2 end = deadReckon({0.0, 0.0, -1.0}, steady, duration, rate_hz);
    const double yaw = -1.0 + rate * duration;
    // a step covers its arc where the exact motion covers the chord: longer by (rate dt)^2 / 24
    const double tolerance = 2.0 * radius * std::pow(rate / rate_hz, 2) / 24.0 + 1e-9;
    EXPECT_NEAR(end.x_m, radius * (std::sin(yaw) - std::sin(-1.0)), tolerance);
    EXPECT_NEAR(end.y_m, radius * (std::cos(-1.0) - std::cos(yaw)), tolerance);
    EXPECT_NEAR(end.yaw_rad, yaw, 1e-9);
  }
}

TEST(DeadReckoning, UsesTheMeanOfBothTwists) {
  const Odometry from = odometryAt(0.0, {1.0, 0.0, 0.0}, {0.0, 0.0, 0.1});
  const Odometry to = odometryAt(2.0, {3.0, 1.0, 0.0}, {0.0, 0.0, 0.3});
  const MotionIncrement motion = motionBetween(from, to);
  EXPECT_DOUBLE_EQ(motion.duration_s, 2.0);
  EXPECT_DOUBLE_EQ(motion.forward_m, 4.0);
  EXPECT_DOUBLE_EQ(motion.left_m, 1.0);
  EXPECT_DOUBLE_EQ(motion.yaw_rad, 0.4);
}

TEST(DeadReckoning, RefusesStampsThatDoNotIncrease) {
  const Odometry first = odometryAt(5.0, {1.0, 0.0, 0.0}, Eigen::Vector3d::Zero());
  for (const double stamp_s : {5.0, 4.9, std::numeric_limits<double>::quiet_NaN()}) {
    const Odometry second = odometryAt(stamp_s, {1.0, 0.0, 0.0}, Eigen::Vector3d::Zero());
    EXPECT_THROW(motionBetween(first, second), std::invalid_argument);
  }
}

TEST(DeadReckoning, KeepsTheYawWrapped) {
  const Odometry steady = odometryAt(0.0, {1.0, 0.0, 0.0}, {0.0, 0.0, 0.5});
  const Pose2 end = deadReckon({0.0, 0.0, 3.0}, steady, 2.0, 10.0);
  EXPECT_NEAR(end.yaw_rad, 4.0 - 2.0 * M_PI, 1e-12);
}

// ---- roll and pitch --------------------------------------------------------------------------

TEST(LevelRotation, TurnsByRollThenPitch) {
  const double roll = 0.3;
  const double pitch = -0.4;
  const Eigen::Vector3d v(1.0, 2.0, 3.0);
  const double across = v.y() * std::cos(roll) - v.z() * std::sin(roll);
  const double up = v.y() * std::sin(roll) + v.z() * std::cos(roll);
  const Eigen::Vector3d expected(v.x() * std::cos(pitch) + up * std::sin(pitch), across,
                                 -v.x() * std::sin(pitch) + up * std::cos(pitch));
  EXPECT_TRUE((levelRotation(roll, pitch) * v).isApprox(expected, 1e-14));
}

// The vehicle turns at a steady roll and pitch: the body rates and the closed forms are those of
// Fossen's Euler-angle kinematics with d roll / dt = d pitch / dt = 0.
TEST(MotionBetween, LevelsTheTwistWithRollAndPitch) {
  const double roll = 0.25;
  const double pitch = 0.35;
  const double yaw_rate = 0.08;
  const Eigen::Vector3d body_mps(2.0, 0.3, -0.4);
  const Eigen::Vector3d body_radps(-yaw_rate * std::sin(pitch),
                                   yaw_rate * std::sin(roll) * std::cos(pitch),
                                   yaw_rate * std::cos(roll) * std::cos(pitch));
  const Attitude attitude{-10.0, roll, pitch};
  const MotionIncrement motion = motionBetween(odometryAt(0.0, body_mps, body_radps, attitude),
                                               odometryAt(0.5, body_mps, body_radps, attitude));
  const double up = body_mps.y() * std::sin(roll) + body_mps.z() * std::cos(roll);
  const double forward = body_mps.x() * std::cos(pitch) + up * std::sin(pitch);
  const double left = body_mps.y() * std::cos(roll) - body_mps.z() * std::sin(roll);
  EXPECT_NEAR(motion.forward_m, 0.5 * forward, 1e-14);
  EXPECT_NEAR(motion.left_m, 0.5 * left, 1e-14);
  EXPECT_NEAR(motion.yaw_rad, 0.5 * yaw_rate, 1e-14);
}

// A vehicle that rolls, pitches and turns all at once, against rotation matrices at 10 kHz.
TEST(MotionBetween, FollowsTheFullThreeDimensionalMotion) {
  const Eigen::Vector3d body_mps(1.5, 0.2, -0.3);
  const auto body_radps = [](double t) {
    return Eigen::Vector3d(0.2 * std::cos(t), 0.15 * std::sin(1.3 * t), 0.1);
  };
  constexpr int kFinePerStep = 100;
  constexpr double kFine_s = 1e-4;
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Odometry from = odometryAt(0.0, body_mps, body_radps(0.0));
  Pose2 pose;
  for (int k = 1; k <= 2000; ++k) {
    for (int i = 0; i < kFinePerStep; ++i) {
      const double middle_s = ((k - 1) * kFinePerStep + i + 0.5) * kFine_s;
      const Eigen::Vector3d turn = body_radps(middle_s) * kFine_s;
      position += R * body_mps * kFine_s;
      R = R * Eigen::AngleAxisd(turn.norm(), turn.normalized());
    }
    const double stamp_s = k * kFinePerStep * kFine_s;
    const Attitude attitude{0.0, std::atan2(R(2, 1), R(2, 2)), -std::asin(R(2, 0))};
    const Odometry to = odometryAt(stamp_s, body_mps, body_radps(stamp_s), attitude);
    pose = advance(pose, motionBetween(from, to));
    from = to;
  }
  // 20 s of 1.5 m/s at 100 Hz: the trapezoidal rule is off by (dt)^2 / 12 of second derivatives of
  // order 0.1, the fine integration by half a fine step, 1e-4 m
  EXPECT_NEAR(pose.x_m, position.x(), 1e-3);
  EXPECT_NEAR(pose.y_m, position.y(), 1e-3);
  EXPECT_NEAR(wrapAngle(pose.yaw_rad - std::atan2(R(1, 0), R(0, 0))), 0.0, 1e-4);
  // and it is not what the yaw rate alone gives: the attitude matters here by far more than that
  EXPECT_GT(std::abs(wrapAngle(pose.yaw_rad - 0.1 * 20.0)), 0.02);
}

// ---- angles ----------------------------------------------------------------------------------

TEST(WrapAngle, LiesInTheHalfOpenIntervalUpToPi) {
  EXPECT_DOUBLE_EQ(wrapAngle(0.0), 0.0);
  EXPECT_DOUBLE_EQ(wrapAngle(M_PI), M_PI);
  EXPECT_DOUBLE_EQ(wrapAngle(-M_PI), M_PI);
  EXPECT_NEAR(wrapAngle(3.0 * M_PI / 2.0), -M_PI / 2.0, 1e-15);
  EXPECT_NEAR(wrapAngle(-3.0 * M_PI / 2.0), M_PI / 2.0, 1e-15);
}

TEST(WrapAngle, ChangesAnAngleByWholeTurnsOnly) {
  for (double angle = -50.0; angle < 50.0; angle += 0.37) {
    const double wrapped = wrapAngle(angle);
    EXPECT_GT(wrapped, -M_PI);
    EXPECT_LE(wrapped, M_PI);
    EXPECT_NEAR(std::cos(wrapped), std::cos(angle), 1e-13);
    EXPECT_NEAR(std::sin(wrapped), std::sin(angle), 1e-13);
  }
}

TEST(Interpolate, MeetsBothEndsAndTheMiddle) {
  const Pose2 a{1.0, 2.0, 0.2};
  const Pose2 b{3.0, -2.0, 0.6};
  EXPECT_DOUBLE_EQ(interpolate(a, b, 0.0).x_m, 1.0);
  EXPECT_DOUBLE_EQ(interpolate(a, b, 1.0).y_m, -2.0);
  EXPECT_DOUBLE_EQ(interpolate(a, b, 1.0).yaw_rad, 0.6);
  const Pose2 quarter = interpolate(a, b, 0.25);
  EXPECT_DOUBLE_EQ(quarter.x_m, 1.5);
  EXPECT_DOUBLE_EQ(quarter.y_m, 1.0);
  EXPECT_DOUBLE_EQ(quarter.yaw_rad, 0.3);
}

TEST(Interpolate, TakesTheShorterWayAcrossPlusMinusPi) {
  const Pose2 a{0.0, 0.0, M_PI - 0.1};
  const Pose2 b{0.0, 0.0, -M_PI + 0.3};
  EXPECT_NEAR(interpolate(a, b, 0.125).yaw_rad, M_PI - 0.05, 1e-14);
  EXPECT_NEAR(interpolate(a, b, 0.5).yaw_rad, -M_PI + 0.1, 1e-14);
  EXPECT_NEAR(interpolate(b, a, 0.5).yaw_rad, -M_PI + 0.1, 1e-14);
}

TEST(Interpolate, TakesDepthRollAndPitchToo) {
  const Attitude a{-10.0, M_PI - 0.1, 0.1};
  const Attitude b{-20.0, -M_PI + 0.1, -0.3};
  const Attitude middle = interpolate(a, b, 0.5);
  EXPECT_DOUBLE_EQ(middle.z_m, -15.0);
  EXPECT_NEAR(std::abs(middle.roll_rad), M_PI, 1e-14);
  EXPECT_NEAR(middle.pitch_rad, -0.1, 1e-14);
}

}  // namespace
}  // namespace rbpf_core
