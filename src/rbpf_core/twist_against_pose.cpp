#include "rbpf_core/twist_against_pose.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "rbpf_core/decimal.hpp"

namespace rbpf_core {

namespace {

constexpr double kWindow_s = 10.0;
// The mean of two twists says little over a longer interval.
constexpr double kLongestInterval_s = 5.0;
// Windows that are looked at together, and how many of them must disagree.
constexpr std::size_t kTogether = 5;
constexpr std::size_t kDisagreeing = 3;

// A window tells something if the vehicle moved by more than this.
constexpr double kSailed_m = 2.0;
constexpr double kTurned_rad = 0.2;
// But not if the pose made more than this share of it in one step: then it is the pose's noise, or
// its jump to a GPS fix, that stands out of a vehicle at rest.
constexpr double kJumpShare = 0.5;
// It disagrees by a difference above this, and above this share of the motion.
constexpr double kTolerance_m = 1.0;
constexpr double kTolerance_rad = 0.1;
constexpr double kToleranceShare = 0.3;

// Rates are missing if the twist turns by less than this share of what the pose does.
constexpr double kNoTurnShare = 0.05;

constexpr double kMpsPerKnot = 0.514444;
constexpr double kDegreesPerRadian = 180.0 / M_PI;

Eigen::Matrix3d rotationOf(const Odometry& odometry) {
  return Eigen::AngleAxisd(odometry.pose.yaw_rad, Eigen::Vector3d::UnitZ()) *
         levelRotation(odometry.attitude.roll_rad, odometry.attitude.pitch_rad);
}

}  // namespace

// ---- windows -------------------------------------------------------------------------------

void TwistAgainstPose::Track::add(const MotionIncrement& motion) {
  end = advance(end, motion);
  turned_rad += motion.yaw_rad;
  largest_step_m = std::max(largest_step_m, std::hypot(motion.forward_m, motion.left_m));
  largest_step_rad = std::max(largest_step_rad, std::abs(motion.yaw_rad));
}

double TwistAgainstPose::Track::straight() const { return std::hypot(end.x_m, end.y_m); }

void TwistAgainstPose::add(const Odometry& odometry) {
  if (finding_) return;
  if (!last_ || !(std::abs(odometry.stamp_s - last_->stamp_s) <= kLongestInterval_s)) {
    return begin(odometry);
  }
  if (odometry.stamp_s <= last_->stamp_s) return;
  extend(odometry);
  if (odometry.stamp_s - window_.begin_s < kWindow_s) return;
  judge();
  begin(odometry);
}

void TwistAgainstPose::begin(const Odometry& odometry) {
  window_ = Window{};
  window_.begin_s = odometry.stamp_s;
  last_ = odometry;
}

void TwistAgainstPose::extend(const Odometry& odometry) {
  const MotionIncrement by_pose = motionOfPoses(*last_, odometry);
  window_.by_pose.add(by_pose);
  for (std::size_t i = 0; i < kRepairs; ++i) {
    window_.by_twist[i].add(repaired(static_cast<Repair>(i), *last_, odometry));
  }
  window_.twist_is_empty &= isTwistEmpty(*last_) && isTwistEmpty(odometry);
  window_.pose_stands_still &=
      by_pose.forward_m == 0.0 && by_pose.left_m == 0.0 && by_pose.yaw_rad == 0.0;
  last_ = odometry;
}

MotionIncrement TwistAgainstPose::repaired(Repair repair, Odometry from, Odometry to) {
  const auto repair_both = [&](const auto& change) {
    change(&from);
    change(&to);
    return motionBetween(from, to);
  };
  switch (repair) {
    case Repair::kNone:
      break;
    case Repair::kYawOfPose: {
      MotionIncrement motion = motionBetween(from, to);
      motion.yaw_rad = wrapAngle(to.pose.yaw_rad - from.pose.yaw_rad);
      return motion;
    }
    case Repair::kDegrees:
      return repair_both([](Odometry* o) { o->angular_radps /= kDegreesPerRadian; });
    case Repair::kOdomFrame:
      return repair_both([](Odometry* o) {
        const Eigen::Matrix3d R = rotationOf(*o).transpose();
        o->linear_mps = R * o->linear_mps;
        o->angular_radps = R * o->angular_radps;
      });
    case Repair::kYawSign:
      return repair_both([](Odometry* o) { o->angular_radps.tail<2>() *= -1.0; });
    case Repair::kKnots:
      return repair_both([](Odometry* o) { o->linear_mps *= kMpsPerKnot; });
  }
  return motionBetween(from, to);
}

// ---- judgement -----------------------------------------------------------------------------

// Differences in units of what is tolerated: above 1 they disagree.

double TwistAgainstPose::positionError(const Window& window, Repair repair) {
  const Track& twist = window.by(repair);
  const Track& pose = window.by_pose;
  const double sailed_m = std::max(twist.straight(), pose.straight());
  const double apart_m = std::hypot(twist.end.x_m - pose.end.x_m, twist.end.y_m - pose.end.y_m);
  return apart_m / std::max(kTolerance_m, kToleranceShare * sailed_m);
}

double TwistAgainstPose::yawError(const Window& window, Repair repair) {
  const double twist_rad = window.by(repair).turned_rad;
  const double pose_rad = window.by_pose.turned_rad;
  const double turned_rad = std::max(std::abs(twist_rad), std::abs(pose_rad));
  return std::abs(twist_rad - pose_rad) / std::max(kTolerance_rad, kToleranceShare * turned_rad);
}

void TwistAgainstPose::judge() {
  const auto judge_among = [this](Windows* windows, double (*error)(const Window&, Repair)) {
    windows->push_back(window_);
    if (windows->size() > kTogether) windows->pop_front();
    const auto disagreeing =
        std::count_if(windows->begin(), windows->end(),
                      [error](const Window& window) { return error(window, Repair::kNone) > 1.0; });
    if (finding_ || disagreeing < static_cast<std::ptrdiff_t>(kDisagreeing)) return;
    finding_ = findingFrom(*windows, static_cast<std::size_t>(disagreeing));
  };
  const Track& twist = window_.by(Repair::kNone);
  const Track& pose = window_.by_pose;
  const double turned_rad = std::max(std::abs(twist.turned_rad), std::abs(pose.turned_rad));
  if (turned_rad > kTurned_rad && pose.largest_step_rad <= kJumpShare * turned_rad) {
    judge_among(&turned_, yawError);
  }
  const double sailed_m = std::max(twist.straight(), pose.straight());
  if (sailed_m > kSailed_m && pose.largest_step_m <= kJumpShare * sailed_m) {
    judge_among(&sailed_, positionError);
  }
}

// ---- causes --------------------------------------------------------------------------------

bool TwistAgainstPose::isExplained(const Windows& windows, Repair repair) {
  const auto disagreeing = std::count_if(windows.begin(), windows.end(), [&](const Window& window) {
    return std::max(positionError(window, repair), yawError(window, repair)) > 1.0;
  });
  return 4 * static_cast<std::size_t>(disagreeing) <= windows.size();
}

std::string TwistAgainstPose::causeOf(const Windows& windows) {
  double turned_by_twist_rad = 0.0;
  double turned_by_pose_rad = 0.0;
  for (const Window& window : windows) {
    turned_by_twist_rad += std::abs(window.by(Repair::kNone).turned_rad);
    turned_by_pose_rad += std::abs(window.by_pose.turned_rad);
  }
  const bool turns_missing = turned_by_twist_rad < kNoTurnShare * turned_by_pose_rad;
  if (turns_missing && isExplained(windows, Repair::kYawOfPose)) {
    return "the twist's yaw rate is missing: with the pose's own turns they agree";
  }
  if (isExplained(windows, Repair::kDegrees)) {
    return "the twist's rates are in degrees a second: divided by 57.3 they agree";
  }
  if (isExplained(windows, Repair::kOdomFrame)) {
    return "the twist is in the odometry's frame, expected in that of child_frame_id: turned into "
           "it they agree";
  }
  if (isExplained(windows, Repair::kYawSign)) {
    return "the twist's yaw rate has the wrong sign (z down?): turned round they agree";
  }
  if (isExplained(windows, Repair::kKnots)) {
    return "the twist's speed is in knots: multiplied by 0.514 they agree";
  }
  return "none of the usual ones; expected is a twist in m/s and rad/s in the frame of "
         "child_frame_id, x forward, z up, and the pose of the same frame";
}

std::string TwistAgainstPose::figuresOf(const Window& window) {
  const auto figures = [](const Track& track) {
    return "(" + decimal(track.end.x_m, 1) + ", " + decimal(track.end.y_m, 1) +
           ") m and turns by " + decimal(track.turned_rad, 2) + " rad";
  };
  return "in the 10 s from " + decimal(window.begin_s, 1) + " s the twist leads to " +
         figures(window.by(Repair::kNone)) + ", the pose to " + figures(window.by_pose);
}

Finding TwistAgainstPose::findingFrom(const Windows& windows, std::size_t disagreeing) const {
  const auto worst =
      std::max_element(windows.begin(), windows.end(), [](const Window& a, const Window& b) {
        const auto error = [](const Window& w) {
          return std::max(positionError(w, Repair::kNone), yawError(w, Repair::kNone));
        };
        return error(a) < error(b);
      });
  const auto all = [&](bool Window::*property) {
    return std::all_of(windows.begin(), windows.end(),
                       [&](const Window& window) { return window.*property; });
  };
  const bool no_twist = all(&Window::twist_is_empty);
  const bool no_pose = all(&Window::pose_stands_still);
  const std::string cause = no_twist  ? "the twist is empty, all zeros"
                            : no_pose ? "the pose is not filled in: the motion can be had from the "
                                        "twist, depth, roll and pitch "
                                        "cannot"
                                      : causeOf(windows);
  const bool is_used = no_twist  ? velocity_ == Velocity::kTwist
                       : no_pose ? velocity_ == Velocity::kPose
                                 : velocity_ != Velocity::kPose;
  return {"twist_against_pose", is_used ? Severity::kError : Severity::kWarning,
          "the odometry's twist and pose disagree in " + std::to_string(disagreeing) + " of " +
              std::to_string(windows.size()) + " windows; " + figuresOf(*worst) +
              ". Likely cause: " + cause};
}

std::optional<Finding> twistAgainstPose(const std::vector<Odometry>& odometry, Velocity velocity) {
  TwistAgainstPose check(velocity);
  for (const Odometry& message : odometry) check.add(message);
  return check.finding();
}

}  // namespace rbpf_core
