// Fixes out of both messages, in map.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

#include "error_of.hpp"
#include "rbpf_node/inputs/from_nav_sat_fix.hpp"
#include "rbpf_node/inputs/from_pose_with_covariance.hpp"

namespace rbpf_node {
namespace {

using rbpf_core::Reason;

const Frames kFrames{"map", "odom", "base_link"};
const FixInputParams kParams{Geographic{57.5, 11.0}, 4.0};

geometry_msgs::PoseWithCovarianceStamped poseMessage() {
  geometry_msgs::PoseWithCovarianceStamped message;
  message.header.stamp = ros::Time(100, 250000000);
  message.header.frame_id = "/map";
  message.pose.pose.position.x = 10.0;
  message.pose.pose.position.y = -20.0;
  message.pose.covariance[0] = 4.0;
  message.pose.covariance[1] = 1.0;
  message.pose.covariance[6] = 1.0;
  message.pose.covariance[7] = 9.0;
  message.pose.covariance[14] = 100.0;
  return message;
}

sensor_msgs::NavSatFix satelliteMessage() {
  sensor_msgs::NavSatFix message;
  message.header.stamp = ros::Time(3.0);
  message.header.frame_id = "gps";
  message.latitude = 57.501;
  message.longitude = 11.002;
  message.altitude = 40.0;
  message.position_covariance_type = sensor_msgs::NavSatFix::COVARIANCE_TYPE_KNOWN;
  message.position_covariance = {4.0, 1.0, 0.0, 1.0, 9.0, 0.0, 0.0, 0.0, 25.0};
  return message;
}

rbpf_core::Fix read(const geometry_msgs::PoseWithCovarianceStamped& message) {
  return toFix(fromPoseWithCovariance(message), kFrames, kParams);
}
rbpf_core::Fix read(const sensor_msgs::NavSatFix& message, const FixInputParams& params = kParams) {
  return toFix(fromNavSatFix(message), kFrames, params);
}

const Eigen::Matrix2d kTold = (Eigen::Matrix2d() << 4.0, 1.0, 1.0, 9.0).finished();

TEST(FromInitialPose, TakesTheHeadingToo) {
  geometry_msgs::PoseWithCovarianceStamped message = poseMessage();
  message.pose.pose.orientation.z = std::sin(1.25);
  message.pose.pose.orientation.w = std::cos(1.25);
  message.pose.covariance[35] = 0.04;
  const rbpf_core::Fix fix = toFix(fromInitialPose(message), kFrames, kParams);
  EXPECT_EQ(fix.position_m, Eigen::Vector2d(10.0, -20.0));
  EXPECT_EQ(fix.covariance_m2, kTold);
  EXPECT_NEAR(fix.heading.value().yaw_rad, 2.5, 1e-12);
  EXPECT_EQ(fix.heading->variance_rad2, 0.04);
  EXPECT_FALSE(read(poseMessage()).heading.has_value());
}

TEST(FromInitialPose, RefusesWhatIsNoRotationOrHasNoVariance) {
  geometry_msgs::PoseWithCovarianceStamped message = poseMessage();
  message.pose.covariance[35] = 0.04;
  const auto reading = [&] { fromInitialPose(message); };
  EXPECT_EQ(errorOf(reading), "initialpose's orientation has the norm 0.000000, expected 1");
  message.pose.pose.orientation.w = 1.0;
  EXPECT_EQ(errorOf(reading), "");
  for (const std::size_t i : {0U, 7U, 35U}) {
    for (const double bad : {0.0, -1.0, std::numeric_limits<double>::infinity()}) {
      auto refused = message;
      refused.pose.covariance[i] = bad;
      const std::string error = errorOf([&] { fromInitialPose(refused); });
      EXPECT_NE(error.find("expected finite and above 0"), std::string::npos) << i << " " << bad;
    }
  }
}

TEST(FromPoseWithCovariance, TakesStampPositionAndItsCovariance) {
  const rbpf_core::Fix fix = read(poseMessage());
  EXPECT_DOUBLE_EQ(fix.stamp_s, 100.25);
  EXPECT_EQ(fix.position_m, Eigen::Vector2d(10.0, -20.0));
  EXPECT_EQ(fix.covariance_m2, kTold);
}

TEST(FromPoseWithCovariance, WithoutACovarianceHasTheParametersOwn) {
  geometry_msgs::PoseWithCovarianceStamped message = poseMessage();
  message.pose.covariance.fill(0.0);
  EXPECT_EQ(read(message).covariance_m2, 16.0 * Eigen::Matrix2d::Identity());
}

TEST(FromPoseWithCovariance, IsRefusedInAnotherFrameByName) {
  geometry_msgs::PoseWithCovarianceStamped message = poseMessage();
  message.header.frame_id = "utm";
  EXPECT_EQ(errorOf([&] { read(message); }), "fix's header.frame_id is 'utm', expected 'map'");
  EXPECT_EQ(reasonOf([&] { read(message); }), Reason::kWrongFrame);
}

TEST(FromNavSatFix, LiesEastAndNorthOfTheSurveysOrigin) {
  const rbpf_core::Fix fix = read(satelliteMessage());
  // radii of curvature of WGS84 at this latitude, a / sqrt(1 - e^2 sin^2) and a (1 - e^2) / (..)^3
  const double a_m = 6378137.0;
  const double e2 = 0.00669437999014;
  const double phi = 57.5 * M_PI / 180.0;
  const double w = std::sqrt(1.0 - e2 * std::sin(phi) * std::sin(phi));
  const double per_degree = M_PI / 180.0;
  // over 160 m the earth bends by 2 mm, the meridians close in by 4 mm
  EXPECT_NEAR(fix.position_m.x(), 0.002 * per_degree * std::cos(phi) * a_m / w, 0.01);
  EXPECT_NEAR(fix.position_m.y(), 0.001 * per_degree * a_m * (1.0 - e2) / (w * w * w), 0.01);
  EXPECT_EQ(fix.covariance_m2, kTold);
  EXPECT_EQ(fix.stamp_s, 3.0);
}

TEST(FromNavSatFix, WithoutAKnownCovarianceHasTheParametersOwn) {
  sensor_msgs::NavSatFix message = satelliteMessage();
  message.position_covariance_type = sensor_msgs::NavSatFix::COVARIANCE_TYPE_UNKNOWN;
  EXPECT_EQ(read(message).covariance_m2, 16.0 * Eigen::Matrix2d::Identity());
}

TEST(FromNavSatFix, IsRefusedWithoutAFixWithoutAnOriginAndOffTheEarth) {
  sensor_msgs::NavSatFix message = satelliteMessage();
  EXPECT_EQ(reasonOf([&] { read(message, {}); }), Reason::kNoOrigin);
  EXPECT_TRUE(contains(errorOf([&] { read(message, {}); }), "expected survey_origin to be set"));
  message.latitude = 97.0;
  EXPECT_EQ(reasonOf([&] { read(message); }), Reason::kMalformed);
  message.latitude = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(reasonOf([&] { read(message); }), Reason::kNotFinite);
  message.status.status = sensor_msgs::NavSatStatus::STATUS_NO_FIX;
  EXPECT_EQ(reasonOf([&] { read(message); }), Reason::kNoFix);
}

}  // namespace
}  // namespace rbpf_node
