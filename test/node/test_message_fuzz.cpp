// Whatever the bytes of a message are, it is read or refused, and takes no more memory than its
// bytes are worth.
#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <gtest/gtest.h>
#include <sensor_msgs/LaserScan.h>
#include <sensor_msgs/NavSatFix.h>
#include <sensor_msgs/PointCloud2.h>
#include <sys/resource.h>

#include <string>
#include <vector>

#include "../core/mutations.hpp"
#include "odometry_message.hpp"
#include "raw_of.hpp"
#include "rbpf_node/conversions.hpp"
#include "rbpf_node/inputs/message_types.hpp"

namespace rbpf_node {
namespace {

using rbpf_core::InputKind;

template <typename Message>
Message stamped(Message message) {
  message.header.stamp = ros::Time(7.0);
  return message;
}

sensor_msgs::PointCloud2 cloud() {
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

sensor_msgs::LaserScan scan() {
  sensor_msgs::LaserScan scan;
  scan.header.frame_id = "mbes";
  scan.angle_increment = 0.1F;
  scan.range_max = 100.0F;
  scan.ranges.assign(12, 20.0F);
  scan.intensities.assign(12, 1.0F);
  return scan;
}

struct Kind {
  InputKind kind;
  RawMessage raw;
};

std::vector<Kind> allKinds() {
  return {{InputKind::kOdometry, rawOf(stamped(odometryMessage()))},
          {InputKind::kPing, rawOf(stamped(cloud()))},
          {InputKind::kPing, rawOf(stamped(scan()))},
          {InputKind::kFix, rawOf(stamped(geometry_msgs::PoseWithCovarianceStamped()))},
          {InputKind::kFix, rawOf(stamped(sensor_msgs::NavSatFix()))}};
}

double peakMb() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) * 1024.0 / 1e6;
}

// Reads a message and what the node makes of it. Returns whether it was taken.
bool isRead(InputKind kind, const RawMessage& raw) {
  try {
    AnyInput input = readInput(kind, raw);
    if (auto* ping = std::get_if<PingInput>(&input)) {
      EXPECT_LE(static_cast<std::size_t>(ping->beams_m.cols()), raw.bytes.size() / 4);
      toPing(*ping, Eigen::Isometry3d::Identity());
    } else if (auto* odometry = std::get_if<OdometryInput>(&input)) {
      toOdometry(*odometry, Frames{});
    }
    return true;
  } catch (const std::invalid_argument&) {
    return false;
  }
}

TEST(FuzzedMessages, AreReadOrRefused) {
  const std::vector<Kind> kinds = allKinds();
  const double before_mb = peakMb();
  std::vector<std::size_t> read(kinds.size());
  std::vector<std::size_t> refused(kinds.size());
  rbpf_core::forManySeeds(60000, [&](std::uint32_t seed) {
    rbpf_core::Mutations mutations(seed);
    const std::size_t k = seed % kinds.size();
    RawMessage raw = kinds[k].raw;
    raw.bytes = mutations.of(raw.bytes);
    ++(isRead(kinds[k].kind, raw) ? read : refused)[k];
  });
  for (std::size_t k = 0; k < kinds.size(); ++k) {
    EXPECT_GT(refused[k], 1000U) << kinds[k].raw.datatype;
    if (kinds[k].kind == InputKind::kFix) continue;  // of zeros: no covariance, no frame
    EXPECT_GT(read[k], 500U) << kinds[k].raw.datatype;
  }
  EXPECT_LT(peakMb() - before_mb, 20.0);
}

// A length in place of each of a message's numbers.
TEST(FuzzedMessages, ThatAnnounceGigabytesAreGivenNone) {
  const double before_mb = peakMb();
  for (const Kind& kind : allKinds()) {
    for (std::size_t at = 0; at + 4 <= kind.raw.bytes.size(); ++at) {
      for (const std::uint8_t high : {0x00, 0x0f, 0x3f, 0x7f, 0xff}) {
        RawMessage raw = kind.raw;
        for (std::size_t i = 0; i < 3; ++i) raw.bytes[at + i] = 0xff;
        raw.bytes[at + 3] = high;
        isRead(kind.kind, raw);
      }
    }
  }
  EXPECT_LT(peakMb() - before_mb, 20.0);
}

}  // namespace
}  // namespace rbpf_node
