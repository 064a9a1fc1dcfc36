// Motion of the vehicle between two odometry messages, and of the particles with it.
#pragma once

#include "rbpf_core/random.hpp"
#include "rbpf_core/types.hpp"

namespace rbpf_core {

// Process noise, standard deviations per square root of a second: the variance grows with time,
// whatever the odometry's rate. Defaults are those of config/default.yaml.
struct MotionNoise {
  // m/sqrt(s), along the vehicle.
  double surge_std_m = 0.05;
  // m/sqrt(s), across the vehicle.
  double sway_std_m = 0.05;
  // rad/sqrt(s)
  double yaw_std_rad = 0.001;
};

// Which of the odometry's two accounts of the motion is used.
enum class Velocity {
  kTwist,
  kPose,
  // The twist, but the pose where the twist is empty.
  kAuto,
};

// Defaults are those of config/default.yaml.
struct OdometryParams {
  Velocity velocity = Velocity::kAuto;
  // A longer interval between two messages is a gap.
  double gap_s = 2.0;
  // A twist is not carried on for longer than this.
  double max_bridge_s = 10.0;
};

// Where the motion over one interval is taken from.
enum class MotionSource { kTwist, kPose, kPoseOverLongGap };
MotionSource motionSource(const Odometry& from, const Odometry& to, const OdometryParams& params);

// All six numbers are exactly zero: what drivers write that only know the pose.
bool isTwistEmpty(const Odometry& odometry);

// What the odometry says of one interval, in the levelled body frame halfway through its turn.
struct MotionIncrement {
  double duration_s = 0.0;
  double forward_m = 0.0;
  double left_m = 0.0;
  double yaw_rad = 0.0;
};

// Turns a vector of the body frame into the levelled body frame (roll, then pitch; yaw is left
// out).
Eigen::Matrix3d levelRotation(double roll_rad, double pitch_rad);

// Euler integration over [from, to] of the mean of both messages' body twists, levelled with their
// attitudes. Throws std::invalid_argument if `to` is not later than `from`.
MotionIncrement motionBetween(const Odometry& from, const Odometry& to);

// The same interval as the difference of both messages' poses; the yaw takes the shorter way round.
MotionIncrement motionOfPoses(const Odometry& from, const Odometry& to);

// The increment laid at the pose's end, without noise: dead reckoning. The heading halfway through
// the interval is used, so that turns at a low odometry rate do not bend the track.
Pose2 advance(const Pose2& pose, const MotionIncrement& motion);

// The same with noise of variance std^2 * duration in surge, sway and yaw.
Pose2 advanceNoisily(const Pose2& pose, const MotionIncrement& motion, const MotionNoise& noise,
                     RandomStream& stream);

// Angle in (-pi, pi].
double wrapAngle(double angle_rad);

// Pose at `share` of the way from a to b, 0 .. 1; the yaw takes the shorter way round.
Pose2 interpolate(const Pose2& a, const Pose2& b, double share);
Attitude interpolate(const Attitude& a, const Attitude& b, double share);

}  // namespace rbpf_core
