#include "rbpf_core/motion_model.hpp"

#include <Eigen/Geometry>
#include <cmath>
#include <random>
#include <stdexcept>
#include <string>

namespace rbpf_core {

namespace {

struct LevelledTwist {
  Eigen::Vector3d linear_mps;
  double yaw_rate_radps;
};

LevelledTwist level(const Odometry& odometry) {
  const double roll = odometry.attitude.roll_rad;
  const double pitch = odometry.attitude.pitch_rad;
  // d yaw / dt = (q sin(roll) + r cos(roll)) / cos(pitch)
  const double yaw_rate =
      (odometry.angular_radps.y() * std::sin(roll) + odometry.angular_radps.z() * std::cos(roll)) /
      std::cos(pitch);
  return {levelRotation(roll, pitch) * odometry.linear_mps, yaw_rate};
}

double durationBetween(const Odometry& from, const Odometry& to) {
  const double duration_s = to.stamp_s - from.stamp_s;
  if (!(duration_s > 0.0)) {
    throw std::invalid_argument("odometry of stamp " + std::to_string(to.stamp_s) +
                                " s: expected a stamp later than the one before, " +
                                std::to_string(from.stamp_s) + " s");
  }
  return duration_s;
}

}  // namespace

bool isTwistEmpty(const Odometry& odometry) {
  return (odometry.linear_mps.array() == 0.0).all() &&
         (odometry.angular_radps.array() == 0.0).all();
}

MotionSource motionSource(const Odometry& from, const Odometry& to, const OdometryParams& params) {
  if (to.stamp_s - from.stamp_s > params.max_bridge_s) return MotionSource::kPoseOverLongGap;
  if (params.velocity == Velocity::kPose) return MotionSource::kPose;
  const bool empty = isTwistEmpty(from) && isTwistEmpty(to);
  return params.velocity == Velocity::kAuto && empty ? MotionSource::kPose : MotionSource::kTwist;
}

Eigen::Matrix3d levelRotation(double roll_rad, double pitch_rad) {
  return (Eigen::AngleAxisd(pitch_rad, Eigen::Vector3d::UnitY()) *
          Eigen::AngleAxisd(roll_rad, Eigen::Vector3d::UnitX()))
      .toRotationMatrix();
}

MotionIncrement motionBetween(const Odometry& from, const Odometry& to) {
  const double duration_s = durationBetween(from, to);
  const LevelledTwist a = level(from);
  const LevelledTwist b = level(to);
  const Eigen::Vector3d mean_mps = 0.5 * (a.linear_mps + b.linear_mps);
  return {duration_s, mean_mps.x() * duration_s, mean_mps.y() * duration_s,
          0.5 * (a.yaw_rate_radps + b.yaw_rate_radps) * duration_s};
}

MotionIncrement motionOfPoses(const Odometry& from, const Odometry& to) {
  const double duration_s = durationBetween(from, to);
  const double yaw = wrapAngle(to.pose.yaw_rad - from.pose.yaw_rad);
  // seen from halfway through the turn, which is how advance() lays it
  const double c = std::cos(from.pose.yaw_rad + 0.5 * yaw);
  const double s = std::sin(from.pose.yaw_rad + 0.5 * yaw);
  const double dx = to.pose.x_m - from.pose.x_m;
  const double dy = to.pose.y_m - from.pose.y_m;
  return {duration_s, c * dx + s * dy, -s * dx + c * dy, yaw};
}

Pose2 advance(const Pose2& pose, const MotionIncrement& motion) {
  const double yaw_halfway = pose.yaw_rad + 0.5 * motion.yaw_rad;
  const double c = std::cos(yaw_halfway);
  const double s = std::sin(yaw_halfway);
  return {pose.x_m + c * motion.forward_m - s * motion.left_m,
          pose.y_m + s * motion.forward_m + c * motion.left_m,
          wrapAngle(pose.yaw_rad + motion.yaw_rad)};
}

Pose2 advanceNoisily(const Pose2& pose, const MotionIncrement& motion, const MotionNoise& noise,
                     RandomStream& stream) {
  std::normal_distribution<double> normal;
  const double root_s = std::sqrt(motion.duration_s);
  MotionIncrement noisy = motion;
  noisy.forward_m += noise.surge_std_m * root_s * normal(stream);
  noisy.left_m += noise.sway_std_m * root_s * normal(stream);
  noisy.yaw_rad += noise.yaw_std_rad * root_s * normal(stream);
  return advance(pose, noisy);
}

double wrapAngle(double angle_rad) {
  const double wrapped = std::remainder(angle_rad, 2.0 * M_PI);
  return wrapped == -M_PI ? M_PI : wrapped;
}

Pose2 interpolate(const Pose2& a, const Pose2& b, double share) {
  return {a.x_m + share * (b.x_m - a.x_m), a.y_m + share * (b.y_m - a.y_m),
          wrapAngle(a.yaw_rad + share * wrapAngle(b.yaw_rad - a.yaw_rad))};
}

Attitude interpolate(const Attitude& a, const Attitude& b, double share) {
  return {a.z_m + share * (b.z_m - a.z_m),
          wrapAngle(a.roll_rad + share * wrapAngle(b.roll_rad - a.roll_rad)),
          a.pitch_rad + share * (b.pitch_rad - a.pitch_rad)};
}

}  // namespace rbpf_core
