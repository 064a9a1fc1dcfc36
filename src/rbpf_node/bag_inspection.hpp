// A whole bag read as the offline replay reads it, and what was found in it as tables.
#pragma once

#include <rosbag/bag.h>
#include <tf2/buffer_core.h>

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "rbpf_core/types.hpp"
#include "rbpf_node/inputs/message_types.hpp"
#include "rbpf_node/number_table.hpp"
#include "rbpf_node/parameters.hpp"
#include "rbpf_node/stamp_order.hpp"

namespace rbpf_node {

class BagInspection {
 public:
  explicit BagInspection(const Parameters& params);

  // Reads all odometry and pings of a bag, once.
  void read(const rosbag::Bag& bag, const OfflineTopics& topics);
  // Odometry messages that are not the filter's.
  void readGroundTruth(const rosbag::Bag& bag, const std::string& topic);

  // facts.json and the tables odometry.npy, pings.npy, beams.npy and ground_truth.npy, whose
  // columns it names, in an existing folder. Throws std::runtime_error if that is not possible.
  void write(const std::string& folder) const;

 private:
  struct Ping {
    PingInput input;
    double record_s;
  };
  // What the beams of a ping are as they came.
  struct Ranges {
    double finite = 0.0;
    double within = 0.0;
    double min_m, median_m, max_m;
  };

  void takeIn(const StampedMessage& message);
  void takeOdometry(const RawMessage& raw, double record_s);
  void takePing(const RawMessage& raw, double record_s);
  void takeWaiting();
  std::vector<double> rowOf(const Ping& ping);
  void tabulate(const Ping& ping);
  void place(const Ping& ping, const Eigen::Isometry3d& T_base_sensor, std::vector<double>* row);
  std::optional<Eigen::Isometry3d> mountOf(const std::string& frame) const;
  Ranges rangesOf(const rbpf_core::Beams& beams_m) const;
  void sampleBeams(double ping, const rbpf_core::Beams& levelled_m, const rbpf_core::Pose2& pose);
  double frameNumber(const std::string& frame);
  std::string mounts() const;
  std::string refusals() const;

  const Parameters params_;
  tf2::BufferCore transforms_;
  // Parent and child.
  std::vector<std::string> links_;
  RefusalCounts refused_;
  std::vector<std::string> frames_;
  // Pings until the odometry after them has come.
  std::deque<Ping> waiting_;
  std::optional<rbpf_core::Odometry> before_;
  std::optional<rbpf_core::Odometry> last_;
  // Every so many pings the beams are looked at one by one.
  std::size_t sample_every_ = 1;

  NumberTable odometry_;
  NumberTable pings_;
  NumberTable beams_;
  NumberTable ground_truth_;
};

}  // namespace rbpf_node
