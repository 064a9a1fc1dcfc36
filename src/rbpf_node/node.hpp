// The SLAM node: messages in, filter, loop closing, messages out. The live node and the offline
// replay hand their messages to the same handlers.
#pragma once

#include <diagnostic_updater/diagnostic_updater.h>
#include <nav_msgs/Odometry.h>
#include <ros/callback_queue.h>
#include <ros/node_handle.h>
#include <sensor_msgs/PointCloud2.h>
#include <std_srvs/Trigger.h>
#include <tf2_ros/buffer.h>

#include <deque>
#include <mutex>

#include "rbpf_core/loop_closing.hpp"
#include "rbpf_node/map_nodes.hpp"
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

  void handleOdometry(const nav_msgs::Odometry::ConstPtr& message);
  void handlePing(const sensor_msgs::PointCloud2::ConstPtr& message);

  // A step of Algorithm 2, if one is due; waits for the map nodes, and logs what goes wrong. To be
  // called from one thread, as often as you like.
  void closeLoops();

  void finish() { filter_.finish(); }  // the survey is over

  tf2_ros::Buffer& transforms() { return transforms_; }
  MapNodes& maps() { return maps_; }
  const rbpf_core::LoopClosing& loopClosing() const { return loop_closing_; }
  const rbpf_core::ParticleFilter& filter() const { return filter_; }

 private:
  void handOnPings();
  bool serveFinish(std_srvs::Trigger::Request& request, std_srvs::Trigger::Response& response);
  void countGap(std::uint32_t seq);
  void notePingAges();
  void publishOverview();
  rbpf_svgp_slam::FilterStatus status() const;
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

  mutable std::mutex mutex_;  // guards what follows
  std::deque<sensor_msgs::PointCloud2::ConstPtr> pings_without_mount_;
  ros::Time last_odometry_;
  std::uint32_t last_seq_ = 0;
  std::uint64_t pings_missed_ = 0;  // gaps in header.seq, and pings whose sensor's mount never came
  std::uint64_t pings_malformed_ = 0;
  std::size_t pings_noted_ = 0;  // whose ages are known
  PingAges ages_;

  ros::ServiceServer finish_server_;
  ros::WallTimer overview_timer_;  // last: what it calls needs all of the above
};

}  // namespace rbpf_node
