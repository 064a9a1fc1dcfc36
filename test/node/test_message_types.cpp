// What the node reads from the bytes of a message, on the wire or in a bag.
#include <gtest/gtest.h>
#include <sensor_msgs/LaserScan.h>
#include <sensor_msgs/PointCloud2.h>
#include <std_msgs/String.h>

#include <string>

#include "error_of.hpp"
#include "odometry_message.hpp"
#include "raw_of.hpp"
#include "rbpf_node/inputs/message_types.hpp"

namespace rbpf_node {
namespace {

std::string refusalOf(rbpf_core::InputKind kind, const RawMessage& raw) {
  return errorOf([&] { readInput(kind, raw); });
}

TEST(ReadInput, FindsTheConversionByTheMessagesType) {
  const AnyInput input = readInput(rbpf_core::InputKind::kOdometry, rawOf(odometryMessage()));
  EXPECT_EQ(std::get<OdometryInput>(input).stamp, ros::Time(100, 250000000));
  EXPECT_EQ(std::get<OdometryInput>(input).position_m, Eigen::Vector3d(10.0, -20.0, -30.0));
}

TEST(ReadInput, ReadsPingsOfEveryType) {
  sensor_msgs::LaserScan scan;
  scan.header.stamp = ros::Time(3.0);
  scan.header.frame_id = "mbes";
  scan.range_max = 100.0F;
  scan.ranges = {10.0F};
  const AnyInput input = readInput(rbpf_core::InputKind::kPing, rawOf(scan));
  EXPECT_EQ(std::get<PingInput>(input).beams_m.cols(), 1);
}

TEST(ReadInput, RefusesATypeThatTheTopicCannotCarry) {
  EXPECT_EQ(refusalOf(rbpf_core::InputKind::kOdometry, rawOf(std_msgs::String())),
            "message is a std_msgs/String with the md5sum 992ce8a1687cec8c8bd883ec73ca41d1, "
            "expected nav_msgs/Odometry");
  EXPECT_TRUE(contains(refusalOf(rbpf_core::InputKind::kPing, rawOf(odometryMessage())),
                       "message is a nav_msgs/Odometry"));
}

TEST(ReadInput, RefusesAnotherVersionOfAType) {
  RawMessage raw = rawOf(odometryMessage());
  raw.md5sum = "0123";
  EXPECT_EQ(refusalOf(rbpf_core::InputKind::kOdometry, raw),
            "message is a nav_msgs/Odometry with the md5sum 0123, expected nav_msgs/Odometry with "
            "the md5sum cd5e73d190d741a2f92e81eda573aca7");
}

TEST(ReadInput, RefusesAMessageWithoutAStamp) {
  nav_msgs::Odometry odometry = odometryMessage();
  odometry.header.stamp = ros::Time();
  EXPECT_EQ(refusalOf(rbpf_core::InputKind::kOdometry, rawOf(odometry)),
            "header.stamp is 0, expected a time");
  EXPECT_EQ(refusalOf(rbpf_core::InputKind::kPing, rawOf(sensor_msgs::PointCloud2())),
            "header.stamp is 0, expected a time");
}

TEST(ReadInput, RefusesBytesThatEndEarly) {
  const RawMessage whole = rawOf(odometryMessage());
  for (std::size_t kept = 0; kept < whole.bytes.size(); kept += 7) {
    RawMessage cut = whole;
    cut.bytes.resize(kept);
    const std::string bytes = std::to_string(kept) + " bytes, expected a whole ";
    EXPECT_TRUE(contains(refusalOf(rbpf_core::InputKind::kOdometry, cut), bytes));
  }
}

TEST(ReadInput, NamesTheReason) {
  const auto reason = [](const RawMessage& raw) {
    return reasonOf([&] { readInput(rbpf_core::InputKind::kOdometry, raw); });
  };
  EXPECT_EQ(reason(rawOf(odometryMessage())), std::nullopt);
  EXPECT_EQ(reason(rawOf(std_msgs::String())), rbpf_core::Reason::kWrongType);
  EXPECT_EQ(reason(rawOf(nav_msgs::Odometry())), rbpf_core::Reason::kNoStamp);
  RawMessage cut = rawOf(odometryMessage());
  cut.bytes.pop_back();
  EXPECT_EQ(reason(cut), rbpf_core::Reason::kMalformed);
}

TEST(ExpectedInsteadOf, IsNothingForWhatIsUnderstood) {
  const RawMessage raw = rawOf(odometryMessage());
  EXPECT_EQ(expectedInsteadOf(rbpf_core::InputKind::kOdometry, raw.datatype, raw.md5sum), "");
  EXPECT_EQ(expectedInsteadOf(rbpf_core::InputKind::kPing, raw.datatype, raw.md5sum),
            "sensor_msgs/PointCloud2 or sensor_msgs/LaserScan");
}

}  // namespace
}  // namespace rbpf_node
