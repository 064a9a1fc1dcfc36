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

#include "rbpf_core/loop_closing.hpp"
#include "rbpf_node/inputs/odometry_input.hpp"
#include "rbpf_node/inputs/ping_input.hpp"
#include "rbpf_node/inputs/refusal.hpp"
#include "rbpf_node/map_nodes.hpp"
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

  // Throws Refusal if the node cannot use it.
  void handle(const OdometryInput& input);
  // Counts whatever is wrong with it.
  void handle(PingInput input);

  // A step of Algorithm 2, if one is due; waits for the map nodes, and logs what goes wrong. To be
  // called from one thread, as often as you like.
  void closeLoops();

  // Counts messages that were not taken in, says so, and tells of them from now on.
  void refuse(InputKind kind, Reason reason, const std::string& what);
  void refuse(const RefusalCounts& refused);

  // The survey is over: what still waits is dropped and counted.
  void finish();

  tf2_ros::Buffer& transforms() { return transforms_; }
  MapNodes& maps() { return maps_; }
  const rbpf_core::LoopClosing& loopClosing() const { return loop_closing_; }
  const rbpf_core::ParticleFilter& filter() const { return filter_; }

 private:
  // These expect mutex_ to be held.
  void note(InputKind kind, Reason reason, const std::string& what, std::uint64_t messages = 1);
  void notePingsLost(Reason dropped, const std::string& what_dropped,
                     const std::string& what_rejected);
  void expectLaterThanLast(const ros::Time& stamp) const;
  std::optional<Eigen::Isometry3d> mountOf(const std::string& frame) const;
  void takeIn(const PingInput& ping, const Eigen::Isometry3d& T_base_sensor);
  void takeInMounted();
  void dropUnmounted(const PingInput& ping);
  void notePingAges();

  bool serveFinish(std_srvs::Trigger::Request& request, std_srvs::Trigger::Response& response);
  void publishOverview();
  rbpf_svgp_slam::FilterStatus status() const;
  void tellInput(const rbpf_core::FilterSnapshot& filter,
                 rbpf_svgp_slam::FilterStatus* status) const;
  void tellLoopClosing(rbpf_svgp_slam::FilterStatus* status) const;
  void diagnoseInput(diagnostic_updater::DiagnosticStatusWrapper& report) const;
  void diagnoseFilter(diagnostic_updater::DiagnosticStatusWrapper& report) const;
  void diagnoseMaps(diagnostic_updater::DiagnosticStatusWrapper& report) const;

  const Parameters params_;
  const Input input_;
  rbpf_core::ParticleFilter filter_;
  MapNodes maps_;
  rbpf_core::LoopClosing loop_closing_;
  Services services_;
  Publishers publishers_;
  tf2_ros::Buffer transforms_;
  diagnostic_updater::Updater diagnostics_;

  // guards what follows
  mutable std::mutex mutex_;
  MountQueue unmounted_;
  ros::Time last_odometry_;
  bool finished_ = false;
  RefusalCounts refused_;
  // what the filter has counted that is in refused_ by now
  rbpf_core::Counters noted_;
  // whose ages are known
  std::size_t pings_noted_ = 0;
  PingAges ages_;

  ros::ServiceServer finish_server_;
  // last: what it calls needs all of the above
  ros::WallTimer overview_timer_;
};

}  // namespace rbpf_node
