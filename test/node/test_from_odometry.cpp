#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

#include "error_of.hpp"
#include "odometry_message.hpp"
#include "rbpf_node/conversions.hpp"
#include "rbpf_node/inputs/from_odometry.hpp"

namespace rbpf_node {
namespace {

const Frames kFrames{"map", "odom", "base_link"};
const double kNaN = std::numeric_limits<double>::quiet_NaN();

rbpf_core::Odometry read(const nav_msgs::Odometry& message) {
  return toOdometry(fromOdometry(message), kFrames);
}

std::string refusalOf(const nav_msgs::Odometry& message) {
  return errorOf([&] { read(message); });
}

TEST(FromOdometry, TakesStampPoseAttitudeAndTwist) {
  const rbpf_core::Odometry odometry = read(odometryMessage());
  EXPECT_DOUBLE_EQ(odometry.stamp_s, 100.25);
  EXPECT_EQ(odometry.pose.x_m, 10.0);
  EXPECT_EQ(odometry.pose.y_m, -20.0);
  EXPECT_NEAR(odometry.pose.yaw_rad, 2.5, 1e-12);
  EXPECT_EQ(odometry.attitude.z_m, -30.0);
  EXPECT_NEAR(odometry.attitude.roll_rad, 0.2, 1e-12);
  EXPECT_NEAR(odometry.attitude.pitch_rad, -0.3, 1e-12);
  EXPECT_EQ(odometry.linear_mps, Eigen::Vector3d(1.0, 2.0, 3.0));
  EXPECT_EQ(odometry.angular_radps, Eigen::Vector3d(0.1, 0.2, 0.3));
}

TEST(FromOdometry, TakesFramesWithASlash) {
  nav_msgs::Odometry message = odometryMessage();
  message.header.frame_id = "/odom";
  message.child_frame_id = "/base_link";
  EXPECT_EQ(refusalOf(message), "");
}

TEST(FromOdometry, RefusesAnotherFrame) {
  nav_msgs::Odometry message = odometryMessage();
  message.header.frame_id = "world_ned";
  EXPECT_TRUE(contains(refusalOf(message), "header.frame_id is 'world_ned', expected 'odom'"));
}

TEST(FromOdometry, RefusesAnotherChildFrame) {
  nav_msgs::Odometry message = odometryMessage();
  message.child_frame_id = "camera";
  EXPECT_TRUE(contains(refusalOf(message), "child_frame_id is 'camera', expected 'base_link'"));
}

TEST(FromOdometry, TakesAnEmptyChildFrameForTheVehicle) {
  nav_msgs::Odometry message = odometryMessage();
  message.child_frame_id = "";
  EXPECT_EQ(refusalOf(message), "");
}

TEST(FromOdometry, TakesAPoseThatIsGivenInMap) {
  nav_msgs::Odometry message = odometryMessage();
  message.header.frame_id = "map";
  EXPECT_EQ(refusalOf(message), "");
}

TEST(FromOdometry, RefusesAnOrientationThatIsNoRotation) {
  nav_msgs::Odometry message = odometryMessage();
  message.pose.pose.orientation = geometry_msgs::Quaternion();  // all zero: not filled in
  EXPECT_TRUE(contains(refusalOf(message), "norm 0.0"));
  message.pose.pose.orientation.w = kNaN;
  EXPECT_TRUE(contains(refusalOf(message), "nan"));
  message.pose.pose.orientation.w = 1.02;
  EXPECT_TRUE(contains(refusalOf(message), "expected 1"));
}

TEST(FromOdometry, RefusesNumbersThatAreNotFinite) {
  nav_msgs::Odometry message = odometryMessage();
  message.twist.twist.linear.y = kNaN;
  EXPECT_EQ(refusalOf(message),
            "odometry's linear velocity is (1, nan, 3), expected finite numbers");
  message = odometryMessage();
  message.pose.pose.position.z = std::numeric_limits<double>::infinity();
  EXPECT_TRUE(contains(refusalOf(message), "position is (10, -20, inf)"));
  message = odometryMessage();
  message.twist.twist.angular.x = kNaN;
  EXPECT_TRUE(contains(refusalOf(message), "angular velocity is (nan, 0.2, 0.3)"));
}

TEST(FromOdometry, NamesTheReason) {
  const auto reason = [](const nav_msgs::Odometry& message) {
    return reasonOf([&] { read(message); });
  };
  EXPECT_EQ(reason(odometryMessage()), std::nullopt);
  nav_msgs::Odometry message = odometryMessage();
  message.header.frame_id = "world_ned";
  EXPECT_EQ(reason(message), rbpf_core::Reason::kWrongFrame);
  message = odometryMessage();
  message.pose.pose.orientation.w = kNaN;
  EXPECT_EQ(reason(message), rbpf_core::Reason::kNotFinite);
  message.pose.pose.orientation.w = 2.0;
  EXPECT_EQ(reason(message), rbpf_core::Reason::kMalformed);
  message = odometryMessage();
  message.pose.pose.position.x = kNaN;
  EXPECT_EQ(reason(message), rbpf_core::Reason::kNotFinite);
}

TEST(FromOdometry, AcceptsARoundedOrientation) {
  nav_msgs::Odometry message = odometryMessage();
  message.pose.pose.orientation.x *= 1.001;
  message.pose.pose.orientation.y *= 1.001;
  message.pose.pose.orientation.z *= 1.001;
  message.pose.pose.orientation.w *= 1.001;
  EXPECT_NEAR(read(message).pose.yaw_rad, 2.5, 1e-12);
}

TEST(RollPitchYaw, ComeBackFromTheRotationTheyMake) {
  for (double roll = -3.0; roll < 3.1; roll += 0.5) {
    for (double pitch = -1.5; pitch < 1.6; pitch += 0.5) {
      for (double yaw = -3.0; yaw < 3.1; yaw += 0.5) {
        const Eigen::Isometry3d T = toIsometry({0.0, 0.0, yaw}, {0.0, roll, pitch});
        const Eigen::Vector3d rpy = rollPitchYaw(Eigen::Quaterniond(T.linear()));
        // 1e-7: asin near a right angle loses half the digits
        ASSERT_LT((rpy - Eigen::Vector3d(roll, pitch, yaw)).norm(), 1e-7);
      }
    }
  }
}

TEST(RollPitchYaw, AreFiniteStraightUp) {
  for (const double pitch : {M_PI / 2.0, -M_PI / 2.0}) {
    const Eigen::Vector3d rpy =
        rollPitchYaw(Eigen::Quaterniond(Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitY())));
    EXPECT_TRUE(rpy.allFinite());
    EXPECT_NEAR(rpy.y(), pitch, 1e-7);
  }
}

}  // namespace
}  // namespace rbpf_node
