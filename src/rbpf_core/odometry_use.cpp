#include "rbpf_core/odometry_use.hpp"

#include <algorithm>

namespace rbpf_core {

namespace {

bool moved(const Pose2& from, const Pose2& to) {
  return from.x_m != to.x_m || from.y_m != to.y_m || from.yaw_rad != to.yaw_rad;
}

}  // namespace

OdometryUse::OdometryUse(const OdometryParams& params)
    : gap_limit_s_(params.gap_s),
      source_(params.velocity == Velocity::kPose ? MotionSource::kPose : MotionSource::kTwist) {}

void OdometryUse::start(const Odometry& first) {
  first_s_ = first.stamp_s;
  last_s_ = first.stamp_s;
}

void OdometryUse::add(const Odometry& from, const Odometry& to, MotionSource source) {
  const double duration_s = to.stamp_s - from.stamp_s;
  unsurveyed_s_ = unsurveyedSeconds(to.stamp_s);
  last_s_ = to.stamp_s;
  if (duration_s > gap_limit_s_) {
    ++gaps_;
    longest_gap_s_ = std::max(longest_gap_s_, duration_s);
  }
  if (source == MotionSource::kPoseOverLongGap) {
    ++long_gaps_;
  } else if (source == MotionSource::kTwist) {
    source_ = source;
  } else if (moved(from.pose, to.pose)) {
    source_ = source;
    ++by_pose_;
    if (!by_pose_since_s_) by_pose_since_s_ = from.stamp_s;
  }
}

double OdometryUse::unsurveyedSeconds(double stamp_s) const {
  if (!first_s_) return 0.0;
  return unsurveyed_s_ + std::max(0.0, stamp_s - last_s_ - gap_limit_s_);
}

double OdometryUse::surveySeconds() const {
  return first_s_ ? last_s_ - *first_s_ - unsurveyed_s_ : 0.0;
}

}  // namespace rbpf_core
