// The SLAM node: inputs, filter, loop closing, messages out. What comes in has passed the same
// door, live and in an offline replay.
#pragma once

#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/callback_queue.h>
#include <ros/node_handle.h>
#include <std_srvs/Trigger.h>
#include <tf2_ros/buffer.h>

#include <mutex>
#include <optional>
#include <string>

#include "rbpf_node/inputs/message_types.hpp"
#include "rbpf_node/loop_closure_loop.hpp"
#include "rbpf_node/mount_queue.hpp"
#include "rbpf_node/ping_ages.hpp"
#include "rbpf_node/publishers.hpp"
#include "rbpf_node/services.hpp"

namespace rbpf_node {

// Where the messages come from: a vehicle (or a bag that is played) at its own pace, or a bag as
// fast as it can be read.
enum class Input { kLive, kBag };

class SlamNode {
 public:
  // Timers go on `node`'s callback queue, services on `private_node`'s.
  SlamNode(ros::NodeHandle node, ros::NodeHandle private_node, const Parameters& params,
           Input input);

  void handle(const OdometryInput& input);
  void handle(PingInput input);

  // A message that told nothing, and what was wrong with it.
  void refuse(InputKind kind, const std::string& why);

  // The survey is over: what still waits is dropped and counted.
  void finish();

  tf2_ros::Buffer& transforms() { return transforms_; }
  MapNodes& maps() { return maps_; }
  LoopClosureLoop& loopClosureLoop() { return loop_; }
  const rbpf_core::ParticleFilter& filter() const { return filter_; }

 private:
  // These expect mutex_ to be held.
  std::optional<Eigen::Isometry3d> mountOf(const std::string& frame) const;
  void takeIn(const PingInput& ping, const Eigen::Isometry3d& T_base_sensor);
  void takeInMounted();
  void dropUnmounted(const PingInput& ping);
  void notePingAges();

  bool serveFinish(std_srvs::Trigger::Request& request, std_srvs::Trigger::Response& response);
  void countGap(std::uint32_t seq);
  void publishOverview();
  rbpf_svgp_slam::FilterStatus status() const;
  void diagnoseInput(diagnostic_updater::DiagnosticStatusWrapper& report) const;
  void diagnoseFilter(diagnostic_updater::DiagnosticStatusWrapper& report) const;
  void diagnoseMaps(diagnostic_updater::DiagnosticStatusWrapper& report) const;

  const Parameters params_;
  const Input input_;
  rbpf_core::ParticleFilter filter_;
  MapNodes maps_;
  LoopClosureLoop loop_;
  Services services_;
  Publishers publishers_;
  tf2_ros::Buffer transforms_;
  diagnostic_updater::Updater diagnostics_;

  // guards what follows
  mutable std::mutex mutex_;
  MountQueue unmounted_;
  ros::Time last_odometry_;
  std::uint32_t last_seq_ = 0;
  // gaps in header.seq, and pings whose sensor's mount never came
  std::uint64_t pings_missed_ = 0;
  std::uint64_t pings_malformed_ = 0;
  // whose ages are known
  std::size_t pings_noted_ = 0;
  PingAges ages_;

  ros::ServiceServer finish_server_;
  // last: what it calls needs all of the above
  ros::WallTimer overview_timer_;
};

}  // namespace rbpf_node
