// What the filter is shielded from: messages of another time, messages that come twice, and values
// that no vehicle has. Messages have been read and are finite; the gate sees them in the order in
// which they came.
#pragma once

#include <deque>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "rbpf_core/motion_model.hpp"
#include "rbpf_core/refusal.hpp"
#include "rbpf_core/types.hpp"

namespace rbpf_core {

// Defaults are those of config/default.yaml.
struct ClockParams {
  // A stamp further ahead of its receipt is refused.
  double max_ahead_s = 10.0;
  // And one further behind it.
  double max_behind_s = 3600.0;
};

struct PlausibilityParams {
  // Of the twist, and of the pose's change where the motion is taken from it.
  double max_speed_mps = 20.0;
  double max_turn_rate_radps = 3.0;
  // Of base_link, below and above the sea.
  double max_depth_m = 12000.0;
  // From base_link to a sensor.
  double max_lever_arm_m = 50.0;
  // A mount that differs by more from the one in use has changed.
  double max_mount_shift_m = 0.02;
  double max_mount_turn_rad = 0.01;
};

struct GateParams {
  ClockParams clock;
  PlausibilityParams plausibility;
  // Says where the motion is taken from.
  OdometryParams odometry;
};

// How far stamps lie ahead of their receipts, as a rule: the median of (stamp - receipt) over a
// recording's odometry if it is beyond the bounds, so that the receipts say nothing of the stamps'
// clock; otherwise 0.
double clockOffset(std::vector<double> stamps_minus_receipts_s, const ClockParams& params);

// A message that is refused leaves the gate as it was: one stamp from the future costs one message.
// To be called from one thread at a time.
class InputGate {
 public:
  explicit InputGate(const GateParams& params, double clock_offset_s = 0.0);

  // Before the first message, of a survey that goes on: the last one that has passed.
  void resume(const Odometry& last) { last_ = last; }

  // What is wrong with a message; nothing if it has passed.
  std::optional<Refusal> check(const Odometry& odometry, double receipt_s);
  std::optional<Refusal> checkPing(double stamp_s, const std::string& frame, double receipt_s);
  std::optional<Refusal> checkFix(double stamp_s, double receipt_s) const;

  // s from a stamp to its receipt, by the same clock; negative if the stamp lies ahead.
  double ageOf(double stamp_s, double receipt_s) const {
    return receipt_s - stamp_s + clock_offset_s_;
  }

 private:
  // Stamps of the pings of one sensor, as they came.
  struct Passed {
    std::deque<double> in_order_s;
    std::set<double> stamps_s;
  };

  std::optional<Refusal> checkClock(const std::string& name, double stamp_s, double receipt_s,
                                    const std::string& cause) const;
  std::optional<Refusal> checkOrder(double stamp_s) const;
  std::optional<Refusal> checkTwist(const Odometry& odometry) const;
  std::optional<Refusal> checkPose(const Odometry& odometry) const;

  const GateParams params_;
  const double clock_offset_s_;
  // The last one that passed.
  std::optional<Odometry> last_;
  std::map<std::string, Passed> pings_;
};

}  // namespace rbpf_core
