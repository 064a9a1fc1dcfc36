// From the door to the filter: gate, mounts, checks of the survey as a whole; and the counts of
// what was not taken in.
#pragma once

#include <tf2_ros/buffer.h>

#include <limits>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "rbpf_core/input_gate.hpp"
#include "rbpf_core/mount_gate.hpp"
#include "rbpf_core/particle_filter.hpp"
#include "rbpf_core/survey_checks.hpp"
#include "rbpf_node/inputs/fix_input.hpp"
#include "rbpf_node/inputs/odometry_input.hpp"
#include "rbpf_node/inputs/ping_input.hpp"
#include "rbpf_node/mount_queue.hpp"
#include "rbpf_node/parameters.hpp"
#include "rbpf_node/ping_ages.hpp"

namespace rbpf_node {

// Where the messages come from: a vehicle (or a bag that is played) at its own pace, or a bag as
// fast as it can be read.
enum class Input { kLive, kBag };

// What there is to tell of the input at one instant.
struct IntakeState {
  ros::Time last_odometry;
  std::size_t pings_without_mount = 0;
  bool mapping_paused = false;
  // by the intake and by the filter
  rbpf_core::RefusalCounts refused;
  std::vector<rbpf_core::Finding> findings;
  // s, of all pings; NaN before the first, and of a bag
  double ping_age_p99_s;
  double ping_age_max_s;
  // s from stamp to receipt of the last ones that passed the gate; NaN before the first
  double odometry_receipt_age_s;
  double ping_receipt_age_s;
};

// May be called from any thread.
class Intake {
 public:
  Intake(const Parameters& params, Input input, const tf2_ros::Buffer& transforms,
         rbpf_core::ParticleFilter* filter);

  // Before anything is taken in: what the filter holds already is not new.
  void resume();

  // Of a bag, before anything is taken in: how far its stamps lie ahead of its record times.
  void setClockOffset(double offset_s);

  // receipt_s: when the message came, or was recorded; 0 where no clock runs yet. Throws Refusal.
  void take(const OdometryInput& input, double receipt_s);
  void take(PingInput input, double receipt_s);
  void take(const FixInput& input, double receipt_s);

  // Counts messages that were not taken in, and says so.
  void refuse(rbpf_core::InputKind kind, rbpf_core::Reason reason, const std::string& what);
  void refuse(const rbpf_core::RefusalCounts& refused);

  // While paused, pings that come are refused. Returns whether it was.
  bool setPaused(bool paused);

  // Takes in the pings whose mounts have come since.
  void retryUnmounted();

  // The survey is over: what still waits is dropped and counted.
  void finish();

  IntakeState state() const;

 private:
  // These expect mutex_ to be held.
  // The gate, set up for the clock of the first message.
  rbpf_core::InputGate& gate(double stamp_s, double receipt_s);
  void note(rbpf_core::InputKind kind, rbpf_core::Reason reason, const std::string& what);
  std::optional<Eigen::Isometry3d> mountOf(const std::string& frame);
  void takePlaced(const PingInput& input);
  void takeMounted();
  void takeIn(const PingInput& ping, const Eigen::Isometry3d& T_base_sensor);
  void add(rbpf_core::Ping ping);
  void lookAtNewPings();
  void tellFindings();
  std::vector<rbpf_core::Finding> findings() const;

  const Parameters params_;
  const Input input_;
  const tf2_ros::Buffer& transforms_;
  rbpf_core::ParticleFilter& filter_;

  // guards what follows
  mutable std::mutex mutex_;
  std::optional<rbpf_core::InputGate> gate_;
  rbpf_core::MountGate mounts_;
  rbpf_core::SurveyChecks checks_;
  MountQueue unmounted_;
  rbpf_core::RefusalCounts refused_;
  bool paused_ = false;
  ros::Time last_odometry_;
  // before the first message nobody knows it
  std::optional<std::string> odometry_frame_;
  // of those that the filter has taken in
  std::size_t pings_seen_ = 0;
  PingAges ages_;
  double odometry_receipt_age_s_ = std::numeric_limits<double>::quiet_NaN();
  double ping_receipt_age_s_ = std::numeric_limits<double>::quiet_NaN();
  // names of findings, and of what else is told of once
  std::set<std::string> told_;
};

}  // namespace rbpf_node
