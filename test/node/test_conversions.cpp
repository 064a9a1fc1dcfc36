#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "error_of.hpp"
#include "rbpf_node/conversions.hpp"

namespace rbpf_node {
namespace {

using sensor_msgs::PointField;

const Frames kFrames{"map", "odom", "base_link"};
const double kNaN = std::numeric_limits<double>::quiet_NaN();

// ---- odometry ----------------------------------------------------------------------------------

nav_msgs::Odometry odometryMessage() {
  nav_msgs::Odometry message;
  message.header.stamp = ros::Time(100, 250000000);
  message.header.frame_id = "odom";
  message.child_frame_id = "base_link";
  const Eigen::Quaterniond q(Eigen::AngleAxisd(2.5, Eigen::Vector3d::UnitZ()) *
                             Eigen::AngleAxisd(-0.3, Eigen::Vector3d::UnitY()) *
                             Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitX()));
  message.pose.pose.orientation.x = q.x();
  message.pose.pose.orientation.y = q.y();
  message.pose.pose.orientation.z = q.z();
  message.pose.pose.orientation.w = q.w();
  message.pose.pose.position.x = 10.0;
  message.pose.pose.position.y = -20.0;
  message.pose.pose.position.z = -30.0;
  message.twist.twist.linear.x = 1.0;
  message.twist.twist.linear.y = 2.0;
  message.twist.twist.linear.z = 3.0;
  message.twist.twist.angular.x = 0.1;
  message.twist.twist.angular.y = 0.2;
  message.twist.twist.angular.z = 0.3;
  return message;
}

std::string refusalOf(const nav_msgs::Odometry& message) {
  return errorOf([&] { toOdometry(message, kFrames); });
}

TEST(ToOdometry, TakesStampPoseAttitudeAndTwist) {
  const rbpf_core::Odometry odometry = toOdometry(odometryMessage(), kFrames);
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

TEST(ToOdometry, RefusesAnotherFrame) {
  nav_msgs::Odometry message = odometryMessage();
  message.header.frame_id = "world_ned";
  EXPECT_TRUE(contains(refusalOf(message), "header.frame_id is 'world_ned', expected 'odom'"));
}

TEST(ToOdometry, RefusesAnotherChildFrame) {
  nav_msgs::Odometry message = odometryMessage();
  message.child_frame_id = "";
  EXPECT_TRUE(contains(refusalOf(message), "child_frame_id is '', expected 'base_link'"));
}

TEST(ToOdometry, RefusesAnOrientationThatIsNoRotation) {
  nav_msgs::Odometry message = odometryMessage();
  message.pose.pose.orientation = geometry_msgs::Quaternion();  // all zero: not filled in
  EXPECT_TRUE(contains(refusalOf(message), "norm 0.0"));
  message.pose.pose.orientation.w = kNaN;
  EXPECT_TRUE(contains(refusalOf(message), "nan"));
  message.pose.pose.orientation.w = 1.02;
  EXPECT_TRUE(contains(refusalOf(message), "expected 1"));
}

TEST(ToOdometry, AcceptsARoundedOrientation) {
  nav_msgs::Odometry message = odometryMessage();
  message.pose.pose.orientation.x *= 1.001;
  message.pose.pose.orientation.y *= 1.001;
  message.pose.pose.orientation.z *= 1.001;
  message.pose.pose.orientation.w *= 1.001;
  EXPECT_NEAR(toOdometry(message, kFrames).pose.yaw_rad, 2.5, 1e-12);
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

// ---- pings -------------------------------------------------------------------------------------

PointField floatField(const std::string& name, std::uint32_t offset) {
  PointField field;
  field.name = name;
  field.offset = offset;
  field.datatype = PointField::FLOAT32;
  field.count = 1;
  return field;
}

// float32 x y z in an order of their own, among other fields and padding.
sensor_msgs::PointCloud2 cloudOf(const std::vector<Eigen::Vector3f>& points) {
  sensor_msgs::PointCloud2 cloud;
  cloud.header.stamp = ros::Time(7, 500000000);
  cloud.header.frame_id = "mbes";
  cloud.fields = {floatField("z", 4), floatField("intensity", 8), floatField("x", 12),
                  floatField("y", 20)};
  cloud.point_step = 28;
  cloud.height = 1;
  cloud.width = static_cast<std::uint32_t>(points.size());
  cloud.row_step = cloud.width * cloud.point_step;
  cloud.data.assign(cloud.row_step, 0xAB);
  for (std::size_t i = 0; i < points.size(); ++i) {
    std::uint8_t* point = cloud.data.data() + i * cloud.point_step;
    std::memcpy(point + 12, &points[i].x(), sizeof(float));
    std::memcpy(point + 20, &points[i].y(), sizeof(float));
    std::memcpy(point + 4, &points[i].z(), sizeof(float));
  }
  return cloud;
}

const std::vector<Eigen::Vector3f> kPoints = {
    {1.0F, 2.0F, -3.0F}, {4.0F, -5.0F, -6.0F}, {0.5F, 0.25F, -0.125F}};

sensor_msgs::PointCloud2 goodCloud() { return cloudOf(kPoints); }

std::string refusalOf(const sensor_msgs::PointCloud2& cloud) {
  return errorOf([&] { toPing(cloud, Eigen::Isometry3d::Identity()); });
}

TEST(ToPing, ReadsFloatsWhereverTheFieldsStand) {
  const rbpf_core::Ping ping = toPing(goodCloud(), Eigen::Isometry3d::Identity());
  EXPECT_DOUBLE_EQ(ping.stamp_s, 7.5);
  ASSERT_EQ(ping.beams_m.cols(), 3);
  for (Eigen::Index i = 0; i < 3; ++i) {
    EXPECT_EQ(Eigen::Vector3f(ping.beams_m.col(i)), kPoints[static_cast<std::size_t>(i)]);
  }
}

TEST(ToPing, BringsBeamsIntoTheBaseFrameAndRemembersWhereTheSensorIs) {
  Eigen::Isometry3d T_base_sensor = Eigen::Isometry3d::Identity();
  T_base_sensor.translation() << 0.5, 0.0, -0.25;
  T_base_sensor.linear() =
      Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitX()).toRotationMatrix();  // looks down
  const rbpf_core::Ping ping = toPing(cloudOf({{1.0F, 2.0F, 30.0F}}), T_base_sensor);
  EXPECT_TRUE(ping.sensor_m.isApprox(Eigen::Vector3f(0.5F, 0.0F, -0.25F)));
  // 1e-5 m: float32 at 30 m
  EXPECT_LT((Eigen::Vector3f(ping.beams_m.col(0)) - Eigen::Vector3f(1.5F, -2.0F, -30.25F)).norm(),
            1e-5F);
}

TEST(ToPing, TakesAnOrganisedCloudRowByRow) {
  sensor_msgs::PointCloud2 cloud = cloudOf({kPoints[0], kPoints[1], kPoints[2], kPoints[0]});
  cloud.height = 2;
  cloud.width = 2;
  cloud.row_step = 2 * cloud.point_step;
  const rbpf_core::Ping ping = toPing(cloud, Eigen::Isometry3d::Identity());
  ASSERT_EQ(ping.beams_m.cols(), 4);
  EXPECT_EQ(Eigen::Vector3f(ping.beams_m.col(2)), kPoints[2]);
}

TEST(ToPing, LeavesNaNToTheFilter) {
  std::vector<Eigen::Vector3f> points = kPoints;
  points[1].setConstant(std::numeric_limits<float>::quiet_NaN());
  const rbpf_core::Ping ping = toPing(cloudOf(points), Eigen::Isometry3d::Identity());
  ASSERT_EQ(ping.beams_m.cols(), 3);
  EXPECT_TRUE(ping.beams_m.col(1).array().isNaN().all());
  EXPECT_EQ(rbpf_core::goodBeams(ping, {}, {0.0, 100.0, 0, 5.0}).cols(), 2);
}

TEST(ToPing, TakesAPingWithoutBeams) {
  EXPECT_EQ(toPing(cloudOf({}), Eigen::Isometry3d::Identity()).beams_m.cols(), 0);
}

TEST(ToPing, RefusesAMissingField) {
  for (const std::string name : {"x", "y", "z"}) {
    sensor_msgs::PointCloud2 cloud = goodCloud();
    for (PointField& field : cloud.fields) {
      if (field.name == name) field.name = "range";
    }
    EXPECT_TRUE(contains(refusalOf(cloud), "no field '" + name + "'")) << refusalOf(cloud);
  }
  EXPECT_FALSE(refusalOf(sensor_msgs::PointCloud2()).empty());
}

TEST(ToPing, RefusesAnotherDatatype) {
  sensor_msgs::PointCloud2 cloud = goodCloud();
  cloud.fields[0].datatype = PointField::FLOAT64;
  EXPECT_TRUE(contains(refusalOf(cloud), "'z' is of datatype 8, expected 7 (float32)"));
}

TEST(ToPing, RefusesAFieldThatReachesBeyondItsPoint) {
  sensor_msgs::PointCloud2 cloud = goodCloud();
  cloud.fields[3].offset = 25;
  EXPECT_TRUE(contains(refusalOf(cloud), "'y' ends after point_step 28"));
  cloud.fields[3].offset = 0xFFFFFFFE;  // must not wrap round
  EXPECT_TRUE(contains(refusalOf(cloud), "'y' ends after point_step 28"));
}

TEST(ToPing, RefusesDataOfTheWrongSize) {
  sensor_msgs::PointCloud2 cloud = goodCloud();
  cloud.data.pop_back();
  EXPECT_TRUE(contains(refusalOf(cloud), "3 points holds 83 bytes, expected 84"));
  cloud = goodCloud();
  cloud.width = 4;
  EXPECT_TRUE(contains(refusalOf(cloud), "4 points holds 84 bytes, expected 112"));
  cloud.width = 0xFFFFFFFF;
  cloud.height = 0xFFFFFFFF;
  EXPECT_FALSE(refusalOf(cloud).empty());
  cloud = goodCloud();
  cloud.height = 0;
  EXPECT_FALSE(refusalOf(cloud).empty());
}

TEST(ToPing, RefusesBigEndianData) {
  sensor_msgs::PointCloud2 cloud = goodCloud();
  cloud.is_bigendian = 1;
  EXPECT_TRUE(contains(refusalOf(cloud), "big-endian, expected little"));
}

// ---- poses and beams ---------------------------------------------------------------------------

TEST(ToPose, IsWhatToOdometryReads) {
  const geometry_msgs::Pose pose = toPose({1.0, 2.0, -3.0}, {-4.0, 0.1, -0.2});
  nav_msgs::Odometry message = odometryMessage();
  message.pose.pose = pose;
  const rbpf_core::Odometry odometry = toOdometry(message, kFrames);
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
