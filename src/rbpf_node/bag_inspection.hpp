// A whole bag taken in as the offline replay takes it, and what was found in it as tables.
#pragma once

#include <rosbag/bag.h>
#include <tf2_ros/buffer.h>

#include <optional>
#include <string>
#include <vector>

#include "rbpf_node/inputs/message_types.hpp"
#include "rbpf_node/intake.hpp"
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

  // facts.json, which names the columns of the tables, and the tables themselves: odometry.npy,
  // pings.npy (as they came), placed.npy (those that the filter has taken in), beams.npy (a sample
  // of theirs) and ground_truth.npy. In an existing folder; throws std::runtime_error if that is
  // not possible.
  void write(const std::string& folder) const;

 private:
  // The ranges of a ping as it came.
  struct Ranges {
    double finite = 0.0;
    double within = 0.0;
    double min_m, median_m, max_m;
  };

  void takeIn(const StampedMessage& message);
  void takeOdometry(const RawMessage& raw, double record_s);
  void takePing(const RawMessage& raw, double record_s);
  void tabulatePlaced();
  void sampleBeams(const rbpf_core::SurveyPing& ping, const rbpf_core::Pose2& pose);
  Ranges rangesOf(const rbpf_core::Beams& beams_m) const;
  double frameNumber(const std::string& frame);
  std::string mounts() const;
  std::string refusals() const;
  std::string findings() const;

  const Parameters params_;
  tf2_ros::Buffer transforms_;
  // one particle, which follows dead reckoning
  rbpf_core::ParticleFilter filter_;
  Intake intake_;
  // [parent, child] of each transform
  std::vector<std::string> links_;
  std::vector<std::string> frames_;
  std::optional<rbpf_core::Odometry> before_;
  std::optional<rbpf_core::Odometry> last_;
  // of so many pings that are taken in, the beams of one are looked at
  std::size_t sample_every_ = 1;

  NumberTable odometry_;
  NumberTable pings_;
  NumberTable placed_;
  NumberTable beams_;
  NumberTable ground_truth_;
};

}  // namespace rbpf_node
