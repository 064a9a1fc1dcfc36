#include "rbpf_core/input_gate.hpp"

#include <algorithm>
#include <cmath>

#include "rbpf_core/decimal.hpp"

namespace rbpf_core {

namespace {

// Far more than come in the seconds for which the filter keeps poses: an older ping is refused
// there.
constexpr std::size_t kStampsKept = 4096;

bool isWithin(double value, double low, double high) {
  return value >= low && value <= high;  // false for NaN
}

std::string seconds(double value) { return decimal(value, 3) + " s"; }

}  // namespace

double clockOffset(std::vector<double> stamps_minus_receipts_s, const ClockParams& params) {
  if (stamps_minus_receipts_s.empty()) return 0.0;
  const auto middle = stamps_minus_receipts_s.begin() +
                      static_cast<std::ptrdiff_t>(stamps_minus_receipts_s.size() / 2);
  std::nth_element(stamps_minus_receipts_s.begin(), middle, stamps_minus_receipts_s.end());
  return isWithin(*middle, -params.max_behind_s, params.max_ahead_s) ? 0.0 : *middle;
}

InputGate::InputGate(const GateParams& params, double clock_offset_s)
    : params_(params), clock_offset_s_(clock_offset_s) {}

// ---- odometry ------------------------------------------------------------------------------

std::optional<Refusal> InputGate::check(const Odometry& odometry, double receipt_s) {
  const std::string name = "odometry of stamp " + seconds(odometry.stamp_s);
  if (auto refusal = checkClock(name, odometry.stamp_s, receipt_s,
                                "Is the clock of the vehicle's navigation set?")) {
    return refusal;
  }
  if (auto refusal = checkOrder(odometry.stamp_s)) return refusal;
  if (auto refusal = checkTwist(odometry)) return refusal;
  if (auto refusal = checkPose(odometry)) return refusal;
  last_ = odometry;
  return std::nullopt;
}

std::optional<Refusal> InputGate::checkOrder(double stamp_s) const {
  if (!last_ || stamp_s > last_->stamp_s) return std::nullopt;
  const bool again = stamp_s == last_->stamp_s;
  return Refusal(again ? Reason::kDuplicateStamp : Reason::kOutOfOrder,
                 "odometry's stamp is " + seconds(stamp_s) + ", expected later than " +
                     seconds(last_->stamp_s) + ", the last one's. " +
                     (again ? "Is it published or recorded twice?"
                            : "Has a clock been set back, or does a bag loop?"));
}

std::optional<Refusal> InputGate::checkTwist(const Odometry& odometry) const {
  const PlausibilityParams& most = params_.plausibility;
  if (params_.odometry.velocity == Velocity::kPose) return std::nullopt;  // nobody looks at it
  const std::string name = "odometry of stamp " + seconds(odometry.stamp_s);
  const double speed_mps = odometry.linear_mps.norm();
  if (!isWithin(speed_mps, 0.0, most.max_speed_mps)) {
    return Refusal(Reason::kImplausibleTwist,
                   name + " says " + decimal(speed_mps, 1) + " m/s, expected at most " +
                       decimal(most.max_speed_mps, 1) + " m/s. Is its twist in m/s?");
  }
  const double rate_radps = odometry.angular_radps.norm();
  if (!isWithin(rate_radps, 0.0, most.max_turn_rate_radps)) {
    return Refusal(Reason::kImplausibleTwist, name + " turns at " + decimal(rate_radps, 2) +
                                                  " rad/s, expected at most " +
                                                  decimal(most.max_turn_rate_radps, 2) +
                                                  " rad/s. Are its rates in degrees a second?");
  }
  return std::nullopt;
}

std::optional<Refusal> InputGate::checkPose(const Odometry& odometry) const {
  const PlausibilityParams& most = params_.plausibility;
  const std::string name = "odometry of stamp " + seconds(odometry.stamp_s);
  const double z_m = odometry.attitude.z_m;
  if (!isWithin(z_m, -most.max_depth_m, most.max_depth_m)) {
    return Refusal(Reason::kImplausiblePose,
                   name + " lies at z = " + decimal(z_m, 1) + " m, expected within +-" +
                       decimal(most.max_depth_m, 1) + " m. Is it in metres?");
  }
  if (!last_ || motionSource(*last_, odometry, params_.odometry) == MotionSource::kTwist) {
    return std::nullopt;
  }
  const double moved_m = std::hypot(odometry.pose.x_m - last_->pose.x_m,  //
                                    odometry.pose.y_m - last_->pose.y_m);
  const double passed_s = odometry.stamp_s - last_->stamp_s;
  if (isWithin(moved_m, 0.0, most.max_speed_mps * passed_s)) return std::nullopt;
  return Refusal(Reason::kImplausiblePose,
                 name + " lies " + decimal(moved_m, 1) + " m from the last one, " +
                     seconds(passed_s) + " before, expected at most " +
                     decimal(most.max_speed_mps, 1) +
                     " m/s. Has the navigation been reset, or does its pose jump with GPS?");
}

// ---- pings ---------------------------------------------------------------------------------

std::optional<Refusal> InputGate::checkPing(double stamp_s, const std::string& frame,
                                            double receipt_s) {
  const std::string name = "ping of stamp " + seconds(stamp_s) + " from '" + frame + "'";
  if (auto refusal = checkClock(name, stamp_s, receipt_s, "Is the sonar's clock set?")) {
    return refusal;
  }
  Passed& passed = pings_[frame];
  if (!passed.stamps_s.insert(stamp_s).second) {
    return Refusal(Reason::kDuplicateStamp, name +
                                                " has come before, expected one a stamp and "
                                                "sensor. Is it published or recorded twice?");
  }
  passed.in_order_s.push_back(stamp_s);
  if (passed.in_order_s.size() > kStampsKept) {
    passed.stamps_s.erase(passed.in_order_s.front());
    passed.in_order_s.pop_front();
  }
  return std::nullopt;
}

// ---- fixes ---------------------------------------------------------------------------------

std::optional<Refusal> InputGate::checkFix(double stamp_s, double receipt_s) const {
  return checkClock("fix of stamp " + seconds(stamp_s), stamp_s, receipt_s,
                    "Is the clock of its source set?");
}

// ---- clocks --------------------------------------------------------------------------------

std::optional<Refusal> InputGate::checkClock(const std::string& name, double stamp_s,
                                             double receipt_s, const std::string& cause) const {
  if (stamp_s == 0.0) {
    return Refusal(Reason::kNoStamp, name + ": header.stamp is 0, expected a time");
  }
  const double ahead_s = -ageOf(stamp_s, receipt_s);
  const ClockParams& bounds = params_.clock;
  if (isWithin(ahead_s, -bounds.max_behind_s, bounds.max_ahead_s)) return std::nullopt;
  if (ahead_s < 0.0) {
    return Refusal(Reason::kClockBehind, name + " was received " + seconds(-ahead_s) +
                                             " later, expected at most " +
                                             seconds(bounds.max_behind_s) + ". " + cause);
  }
  return Refusal(Reason::kClockAhead, name + " is " + seconds(ahead_s) +
                                          " ahead of its receipt, expected at most " +
                                          seconds(bounds.max_ahead_s) + ". " + cause);
}

}  // namespace rbpf_core
