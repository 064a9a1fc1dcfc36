// What has become of the odometry: its gaps, and where the motion was taken from.
#pragma once

#include <cstdint>
#include <optional>

#include "rbpf_core/motion_model.hpp"

namespace rbpf_core {

class OdometryUse {
 public:
  explicit OdometryUse(const OdometryParams& params = {});

  // The first message.
  void start(const Odometry& first);
  // An interval over which the vehicle has been moved.
  void add(const Odometry& from, const Odometry& to, MotionSource source);

  // Seconds before a stamp that are no survey time. Of each gap only the first gap_s seconds are:
  // until then nobody knows that it is one. What has followed the last message counts alike, so
  // that survey time, the stamp minus this, never runs backwards. A stamp before the last message's
  // counts as one after it.
  double unsurveyedSeconds(double stamp_s) const;
  // Seconds of survey between the first message and the last.
  double surveySeconds() const;

  // Intervals longer than gap_s, and of them those longer than max_bridge_s.
  std::uint64_t gaps() const { return gaps_; }
  std::uint64_t longGaps() const { return long_gaps_; }
  double longestGapSeconds() const { return longest_gap_s_; }

  // Of the last interval that was no long gap: kTwist or kPose. One in which pose and twist agree
  // that the vehicle rests tells nothing.
  MotionSource source() const { return source_; }
  // Intervals in which the vehicle moved as the pose says, for want of a twist or as it was wished;
  // and the stamp at which the first of them began.
  std::uint64_t intervalsByPose() const { return by_pose_; }
  std::optional<double> byPoseSince() const { return by_pose_since_s_; }

 private:
  double gap_limit_s_;
  std::optional<double> first_s_;
  double last_s_ = 0.0;
  double unsurveyed_s_ = 0.0;
  std::uint64_t gaps_ = 0;
  std::uint64_t long_gaps_ = 0;
  double longest_gap_s_ = 0.0;
  MotionSource source_;
  std::uint64_t by_pose_ = 0;
  std::optional<double> by_pose_since_s_;
};

}  // namespace rbpf_core
