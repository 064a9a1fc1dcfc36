#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "error_of.hpp"
#include "odometry_message.hpp"
#include "rbpf_core/ping_filter.hpp"
#include "rbpf_node/conversions.hpp"
#include "rbpf_node/inputs/from_odometry.hpp"

namespace rbpf_node {
namespace {

// ---- poses and beams ---------------------------------------------------------------------------

TEST(ToPose, IsWhatToOdometryReads) {
  const geometry_msgs::Pose pose = toPose({1.0, 2.0, -3.0}, {-4.0, 0.1, -0.2});
  nav_msgs::Odometry message = odometryMessage();
  message.pose.pose = pose;
  const rbpf_core::Odometry odometry = toOdometry(fromOdometry(message), Frames());
  EXPECT_EQ(odometry.pose.x_m, 1.0);
  EXPECT_EQ(odometry.pose.y_m, 2.0);
  EXPECT_NEAR(odometry.pose.yaw_rad, -3.0, 1e-12);
  EXPECT_EQ(odometry.attitude.z_m, -4.0);
  EXPECT_NEAR(odometry.attitude.roll_rad, 0.1, 1e-12);
  EXPECT_NEAR(odometry.attitude.pitch_rad, -0.2, 1e-12);
}

TEST(PlaceBeams, OnLevelledBeamsIsTheWholeTransformOnBodyBeams) {
  const rbpf_core::Pose2 pose{10.0, -20.0, 2.0};
  const rbpf_core::Attitude attitude{-5.0, 0.3, -0.2};
  rbpf_core::Beams beams(3, 2);
  beams << 1.0F, -4.0F, 2.0F, 15.0F, -20.0F, -30.0F;
  const rbpf_core::Beams placed = placeBeams(rbpf_core::levelBeams(beams, attitude), pose);
  const Eigen::Matrix3Xf expected =
      (toIsometry(pose, attitude) * beams.cast<double>().colwise().homogeneous())
          .cast<float>()
          .topRows<3>();
  EXPECT_LT((placed - expected).norm(), 2e-5F);  // float32 at 40 m
}

// ---- payloads ----------------------------------------------------------------------------------

TEST(Payload, ComesBackAsItWent) {
  const std::vector<float> values = {1.0F, -0.0F, 3.14F, 1e-38F, 1e38F};
  std::vector<std::uint8_t> bytes;
  appendBytes(values.data(), 2, &bytes);
  appendBytes(values.data() + 2, 3, &bytes);
  EXPECT_EQ(toFloats(bytes, 5, "values"), values);
}

TEST(Payload, IsLittleEndian) {
  const float one = 1.0F;  // 0x3F800000
  std::vector<std::uint8_t> bytes;
  appendBytes(&one, 1, &bytes);
  EXPECT_EQ(bytes, (std::vector<std::uint8_t>{0x00, 0x00, 0x80, 0x3F}));
}

TEST(Payload, OfTheWrongSizeIsRefused) {
  const std::vector<std::uint8_t> bytes(10);
  const std::string error = errorOf([&] { toFloats(bytes, 3, "svgp_node_1/predict mean"); });
  EXPECT_EQ(error, "svgp_node_1/predict mean holds 10 bytes, expected 12");
  EXPECT_TRUE(toFloats({}, 0, "nothing").empty());
}

}  // namespace
}  // namespace rbpf_node
