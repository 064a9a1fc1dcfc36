#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <gtest/gtest.h>
#include <nav_msgs/Odometry.h>
#include <sensor_msgs/PointCloud2.h>
#include <std_msgs/String.h>

#include <cstdio>
#include <fstream>
#include <iterator>
#include <set>
#include <stdexcept>
#include <string>

#include "rbpf_node/stamp_order.hpp"

namespace rbpf_node {
namespace {

const OfflineTopics kTopics{"/odom", "/pings", "/fixes"};

class StampOrderTest : public testing::Test {
 protected:
  void SetUp() override {
    ros::Time::init();  // for throttled messages, without a node
    writer_.open(path_, rosbag::bagmode::Write);
  }
  void TearDown() override { std::remove(path_.c_str()); }

  template <typename Message>
  void write(const std::string& topic, double received_s, double stamp_s) {
    Message message;
    message.header.stamp = ros::Time(stamp_s);
    writer_.write(topic, ros::Time(received_s), message);
  }

  std::string errorOfOpening() {
    try {
      rosbag::Bag bag;
      openBag(path_, kTopics, &bag);
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "";
  }

  // What has been written; the messages refer to bag_.
  StampOrder readBack() {
    writer_.close();
    const OfflineTopics topics = openBag(path_, kTopics, &bag_);
    return inStampOrder(bag_, topics, rbpf_core::ClockParams());
  }

  const std::string path_ =
      testing::TempDir() + testing::UnitTest::GetInstance()->current_test_info()->name() + ".bag";
  rosbag::Bag writer_;
  rosbag::Bag bag_;
};

TEST_F(StampOrderTest, IsThatOfTheHeadersWheneverTheMessagesCame) {
  write<nav_msgs::Odometry>("/odom", 10.0, 3.0);
  write<nav_msgs::Odometry>("/odom", 11.0, 1.0);
  write<sensor_msgs::PointCloud2>("/pings", 5.0, 3.0);
  write<sensor_msgs::PointCloud2>("/pings", 6.0, 2.0);
  const StampOrder order = readBack();
  ASSERT_EQ(order.messages.size(), 4U);
  EXPECT_EQ(order.refused.total(), 0U);
  const double stamps_s[] = {1.0, 2.0, 3.0, 3.0};
  const rbpf_core::InputKind kinds[] = {
      rbpf_core::InputKind::kOdometry, rbpf_core::InputKind::kPing, rbpf_core::InputKind::kOdometry,
      rbpf_core::InputKind::kPing};
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(order.messages[i].stamp.toSec(), stamps_s[i]);
    EXPECT_EQ(order.messages[i].kind, kinds[i]);
  }
  EXPECT_EQ(order.messages[1].instance.getTime().toSec(), 6.0);
}

TEST_F(StampOrderTest, HasFixesWhereThereAreAny) {
  write<nav_msgs::Odometry>("/odom", 1.0, 1.0);
  write<nav_msgs::Odometry>("/odom", 5.0, 5.0);
  write<sensor_msgs::PointCloud2>("/pings", 2.0, 2.0);
  write<geometry_msgs::PoseWithCovarianceStamped>("/fixes", 4.0, 1.0);  // late
  write<geometry_msgs::PoseWithCovarianceStamped>("/fixes", 9.0, 9.0);
  const StampOrder order = readBack();
  ASSERT_EQ(order.messages.size(), 5U);
  EXPECT_EQ(order.messages[1].kind, rbpf_core::InputKind::kFix);
  EXPECT_EQ(order.messages[1].stamp.toSec(), 1.0);
  EXPECT_EQ(order.end_s, 5.0);  // a fix is no survey
}

TEST_F(StampOrderTest, NamesTheSensorsFrames) {
  write<nav_msgs::Odometry>("/odom", 1.0, 1.0);
  for (const std::string frame : {"mbes", "/mbes", "sidescan"}) {
    sensor_msgs::PointCloud2 ping;
    ping.header.stamp = ros::Time(2.0);
    ping.header.frame_id = frame;
    writer_.write("/pings", ros::Time(2.0), ping);
  }
  EXPECT_EQ(readBack().ping_frames, (std::set<std::string>{"mbes", "sidescan"}));
}

TEST_F(StampOrderTest, LeavesOutMessagesWithoutAStamp) {
  write<nav_msgs::Odometry>("/odom", 1.0, 1.0);
  write<nav_msgs::Odometry>("/odom", 2.0, 0.0);
  write<sensor_msgs::PointCloud2>("/pings", 1.0, 1.0);
  const StampOrder order = readBack();
  EXPECT_EQ(order.messages.size(), 2U);
  EXPECT_EQ(order.refused.total(), 1U);
  EXPECT_EQ(
      order.refused.counts().count({rbpf_core::InputKind::kOdometry, rbpf_core::Reason::kNoStamp}),
      1U);
}

TEST_F(StampOrderTest, WantsBothTopics) {
  write<nav_msgs::Odometry>("/odom", 1.0, 1.0);
  writer_.close();
  EXPECT_EQ(errorOfOpening(), path_ + " holds no message on /pings; its topics are /odom");
}

TEST_F(StampOrderTest, WantsTheRightTypes) {
  write<nav_msgs::Odometry>("/odom", 1.0, 1.0);
  writer_.write("/pings", ros::Time(1.0), std_msgs::String());
  writer_.close();
  EXPECT_EQ(errorOfOpening(),
            path_ +
                " holds std_msgs/String on /pings, expected sensor_msgs/PointCloud2 or "
                "sensor_msgs/LaserScan");
}

TEST_F(StampOrderTest, SaysWhatIsWrongWithABagThatWasCutOff) {
  write<nav_msgs::Odometry>("/odom", 1.0, 1.0);
  write<sensor_msgs::PointCloud2>("/pings", 1.0, 1.0);
  writer_.close();
  std::ifstream file(path_, std::ios::binary);
  const std::string whole((std::istreambuf_iterator<char>(file)), {});
  for (const std::size_t kept : {whole.size() / 2, whole.size() - 10, std::size_t{5000}}) {
    std::ofstream(path_, std::ios::binary) << whole.substr(0, kept);
    EXPECT_NE(errorOfOpening().find(path_), std::string::npos) << kept << " bytes";
  }
}

TEST_F(StampOrderTest, SaysWhatIsWrongWithAFileThatIsNotABag) {
  writer_.close();
  std::ofstream(path_) << "not a bag";
  EXPECT_NE(errorOfOpening().find(path_ + " cannot be read"), std::string::npos);
}

}  // namespace
}  // namespace rbpf_node
