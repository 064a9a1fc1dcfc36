// A message of whatever bytes, and what the node makes of it.
#pragma once

#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <sensor_msgs/LaserScan.h>
#include <sensor_msgs/NavSatFix.h>
#include <sensor_msgs/PointCloud2.h>

#include <cmath>
#include <vector>

#include "../fuzz/promise.hpp"
#include "odometry_message.hpp"
#include "raw_of.hpp"
#include "rbpf_node/inputs/message_types.hpp"

namespace rbpf_node {

using rbpf_core::InputKind;

template <typename Message>
Message stamped(Message message) {
  message.header.stamp = ros::Time(7.0);
  return message;
}

inline sensor_msgs::PointCloud2 wholeCloud() {
  sensor_msgs::PointCloud2 cloud;
  cloud.header.frame_id = "mbes";
  for (const char* name : {"x", "y", "z", "intensity"}) {
    sensor_msgs::PointField field;
    field.name = name;
    field.offset = static_cast<std::uint32_t>(4 * cloud.fields.size());
    field.datatype = sensor_msgs::PointField::FLOAT32;
    field.count = 1;
    cloud.fields.push_back(field);
  }
  cloud.point_step = 16;
  cloud.height = 2;
  cloud.width = 6;
  cloud.row_step = cloud.width * cloud.point_step;
  cloud.data.resize(cloud.row_step * cloud.height, 0x41);
  return cloud;
}

inline sensor_msgs::LaserScan wholeScan() {
  sensor_msgs::LaserScan scan;
  scan.header.frame_id = "mbes";
  scan.angle_increment = 0.1F;
  scan.range_max = 100.0F;
  scan.ranges.assign(12, 20.0F);
  scan.intensities.assign(12, 1.0F);
  return scan;
}

struct WholeMessage {
  InputKind kind;
  RawMessage raw;
};

// One of each type that the node takes in.
inline std::vector<WholeMessage> wholeMessages() {
  return {{InputKind::kOdometry, rawOf(stamped(odometryMessage()))},
          {InputKind::kPing, rawOf(stamped(wholeCloud()))},
          {InputKind::kPing, rawOf(stamped(wholeScan()))},
          {InputKind::kFix, rawOf(stamped(geometry_msgs::PoseWithCovarianceStamped()))},
          {InputKind::kFix, rawOf(stamped(sensor_msgs::NavSatFix()))}};
}

// Whether it was taken; otherwise it was refused.
inline bool isRead(InputKind kind, const RawMessage& raw) {
  FixInputParams fixes;
  fixes.survey_origin = Geographic{58.25, 11.5};
  try {
    AnyInput input = readInput(kind, raw);
    if (auto* ping = std::get_if<PingInput>(&input)) {
      promise(static_cast<std::size_t>(ping->beams_m.cols()) <= raw.bytes.size() / 4,
              "no more beams than there are bytes");
      toPing(*ping, Eigen::Isometry3d::Identity());
    } else if (auto* odometry = std::get_if<OdometryInput>(&input)) {
      promise(std::isfinite(toOdometry(*odometry, Frames{}).pose.yaw_rad), "a heading is finite");
    } else if (auto* fix = std::get_if<FixInput>(&input)) {
      toFix(*fix, Frames{}, fixes);
    }
    return true;
  } catch (const std::invalid_argument&) {
    return false;
  }
}

}  // namespace rbpf_node
