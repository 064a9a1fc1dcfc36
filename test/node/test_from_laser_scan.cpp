#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "error_of.hpp"
#include "rbpf_node/inputs/from_laser_scan.hpp"

namespace rbpf_node {
namespace {

const float kNaN = std::numeric_limits<float>::quiet_NaN();
const float kInfinity = std::numeric_limits<float>::infinity();

sensor_msgs::LaserScan scanOf(const std::vector<float>& ranges_m) {
  sensor_msgs::LaserScan scan;
  scan.header.stamp = ros::Time(7, 500000000);
  scan.header.frame_id = "mbes";
  scan.angle_min = -1.0F;
  scan.angle_increment = 0.5F;
  scan.range_min = 0.5F;
  scan.range_max = 100.0F;
  scan.ranges = ranges_m;
  return scan;
}

std::string refusalOf(const sensor_msgs::LaserScan& scan) {
  return errorOf([&] { fromLaserScan(scan); });
}

TEST(FromLaserScan, FansTheRangesOutFromXTowardsY) {
  const PingInput input = fromLaserScan(scanOf({10.0F, 20.0F, 30.0F, 40.0F}));
  EXPECT_EQ(input.stamp, ros::Time(7, 500000000));
  EXPECT_EQ(input.frame, "mbes");
  ASSERT_EQ(input.beams_m.cols(), 4);
  for (int i = 0; i < 4; ++i) {
    const double angle_rad = -1.0 + 0.5 * i;
    const double range_m = 10.0 * (i + 1);
    const Eigen::Vector3d expected(range_m * std::cos(angle_rad), range_m * std::sin(angle_rad),
                                   0.0);
    // 1e-5 m: float32 at 40 m
    EXPECT_LT((input.beams_m.col(i).cast<double>() - expected).norm(), 1e-5);
  }
}

TEST(FromLaserScan, MayTurnTheOtherWay) {
  sensor_msgs::LaserScan scan = scanOf({10.0F, 10.0F});
  scan.angle_min = 0.0F;
  scan.angle_increment = -static_cast<float>(M_PI_2);
  const PingInput input = fromLaserScan(scan);
  EXPECT_LT((Eigen::Vector3f(input.beams_m.col(1)) - Eigen::Vector3f(0.0F, -10.0F, 0.0F)).norm(),
            1e-5F);
}

TEST(FromLaserScan, SeesNothingBeyondItsRanges) {
  const PingInput input = fromLaserScan(
      scanOf({0.49F, 0.5F, 100.0F, 100.1F, kNaN, kInfinity, -kInfinity, -10.0F, 0.0F, 50.0F}));
  ASSERT_EQ(input.beams_m.cols(), 3);
  EXPECT_NEAR(input.beams_m.col(0).norm(), 0.5F, 1e-6F);
  EXPECT_NEAR(input.beams_m.col(1).norm(), 100.0F, 1e-4F);
  EXPECT_NEAR(input.beams_m.col(2).norm(), 50.0F, 1e-4F);
  sensor_msgs::LaserScan unlimited = scanOf({kInfinity, 1000.0F});
  unlimited.range_max = kInfinity;
  EXPECT_EQ(fromLaserScan(unlimited).beams_m.cols(), 1);
}

TEST(FromLaserScan, IsBroughtIntoTheBaseFrameByItsMount) {
  // x down, y to port, as a fan across the track is mounted
  Eigen::Isometry3d T_base_sensor = Eigen::Isometry3d::Identity();
  T_base_sensor.translation() << 1.0, 0.0, -0.5;
  T_base_sensor.linear().col(0) = -Eigen::Vector3d::UnitZ();
  T_base_sensor.linear().col(1) = Eigen::Vector3d::UnitY();
  T_base_sensor.linear().col(2) = Eigen::Vector3d::UnitX();
  sensor_msgs::LaserScan scan = scanOf({20.0F, 20.0F});
  scan.angle_min = 0.0F;
  scan.angle_increment = static_cast<float>(M_PI / 6.0);
  const rbpf_core::Ping ping = toPing(fromLaserScan(scan), T_base_sensor);
  const float down_m = 20.0F * std::cos(static_cast<float>(M_PI / 6.0));
  // 1e-5 m: float32 at 20 m
  EXPECT_LT((Eigen::Vector3f(ping.beams_m.col(0)) - Eigen::Vector3f(1.0F, 0.0F, -20.5F)).norm(),
            1e-5F);
  EXPECT_LT(
      (Eigen::Vector3f(ping.beams_m.col(1)) - Eigen::Vector3f(1.0F, 10.0F, -0.5F - down_m)).norm(),
      1e-5F);
}

TEST(FromLaserScan, TakesAScanWithoutRanges) {
  EXPECT_EQ(fromLaserScan(scanOf({})).beams_m.cols(), 0);
}

TEST(FromLaserScan, RefusesAnglesThatAreNone) {
  sensor_msgs::LaserScan scan = scanOf({1.0F, 2.0F});
  scan.angle_min = kNaN;
  EXPECT_TRUE(contains(refusalOf(scan), "angle_min is nan, expected a finite number"));
  scan = scanOf({1.0F, 2.0F});
  scan.angle_increment = kInfinity;
  EXPECT_TRUE(contains(refusalOf(scan), "angle_increment is inf, expected a finite number"));
  scan.angle_increment = 0.0F;
  EXPECT_TRUE(
      contains(refusalOf(scan), "angle_increment is 0, expected another angle for each of"));
  scan.ranges = {1.0F};
  EXPECT_EQ(refusalOf(scan), "");
}

TEST(FromLaserScan, RefusesALimitThatLetsNothingThrough) {
  sensor_msgs::LaserScan scan = scanOf({1.0F});
  scan.range_max = 0.0F;  // not filled in
  EXPECT_TRUE(contains(refusalOf(scan), "range_min .. range_max is 0.500000 .. 0.000000"));
  scan.range_max = kNaN;
  EXPECT_FALSE(refusalOf(scan).empty());
  scan = scanOf({1.0F});
  scan.range_min = -1.0F;
  EXPECT_FALSE(refusalOf(scan).empty());
}

}  // namespace
}  // namespace rbpf_node
