#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <iterator>
#include <limits>
#include <string>
#include <vector>

#include "error_of.hpp"
#include "rbpf_core/ping_filter.hpp"
#include "rbpf_node/inputs/from_point_cloud2.hpp"

namespace rbpf_node {
namespace {

using sensor_msgs::PointField;

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

rbpf_core::Ping read(const sensor_msgs::PointCloud2& cloud) {
  return toPing(fromPointCloud2(cloud), Eigen::Isometry3d::Identity());
}

std::string refusalOf(const sensor_msgs::PointCloud2& cloud) {
  return errorOf([&] { read(cloud); });
}

TEST(FromPointCloud2, ReadsFloatsWhereverTheFieldsStand) {
  const rbpf_core::Ping ping = read(goodCloud());
  EXPECT_DOUBLE_EQ(ping.stamp_s, 7.5);
  ASSERT_EQ(ping.beams_m.cols(), 3);
  for (Eigen::Index i = 0; i < 3; ++i) {
    EXPECT_EQ(Eigen::Vector3f(ping.beams_m.col(i)), kPoints[static_cast<std::size_t>(i)]);
  }
}

TEST(FromPointCloud2, BringsBeamsIntoTheBaseFrameAndRemembersWhereTheSensorIs) {
  Eigen::Isometry3d T_base_sensor = Eigen::Isometry3d::Identity();
  T_base_sensor.translation() << 0.5, 0.0, -0.25;
  T_base_sensor.linear() =
      Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitX()).toRotationMatrix();  // looks down
  const rbpf_core::Ping ping =
      toPing(fromPointCloud2(cloudOf({{1.0F, 2.0F, 30.0F}})), T_base_sensor);
  EXPECT_TRUE(ping.sensor_m.isApprox(Eigen::Vector3f(0.5F, 0.0F, -0.25F)));
  // 1e-5 m: float32 at 30 m
  EXPECT_LT((Eigen::Vector3f(ping.beams_m.col(0)) - Eigen::Vector3f(1.5F, -2.0F, -30.25F)).norm(),
            1e-5F);
}

TEST(FromPointCloud2, TakesAnOrganisedCloudRowByRow) {
  sensor_msgs::PointCloud2 cloud = cloudOf({kPoints[0], kPoints[1], kPoints[2], kPoints[0]});
  cloud.height = 2;
  cloud.width = 2;
  cloud.row_step = 2 * cloud.point_step;
  const rbpf_core::Ping ping = read(cloud);
  ASSERT_EQ(ping.beams_m.cols(), 4);
  EXPECT_EQ(Eigen::Vector3f(ping.beams_m.col(2)), kPoints[2]);
}

// The same points in every layout that there is.
struct Layout {
  bool is_double;
  bool is_bigendian;
  std::uint32_t height;
  std::uint32_t padding;  // bytes after each row
};

template <typename Number>
void put(Number value, bool is_bigendian, std::uint8_t* target) {
  std::uint8_t bytes[sizeof(Number)];
  std::memcpy(bytes, &value, sizeof(Number));
  if (is_bigendian) std::reverse(std::begin(bytes), std::end(bytes));
  std::memcpy(target, bytes, sizeof(Number));
}

sensor_msgs::PointCloud2 cloudLaidOut(const std::vector<Eigen::Vector3f>& points,
                                      const Layout& layout) {
  const std::uint32_t size = layout.is_double ? 8 : 4;
  sensor_msgs::PointCloud2 cloud;
  cloud.header.frame_id = "mbes";
  cloud.is_bigendian = layout.is_bigendian;
  cloud.fields = {floatField("y", 3), floatField("z", 3 + size), floatField("x", 3 + 2 * size)};
  for (PointField& field : cloud.fields) {
    if (layout.is_double) field.datatype = PointField::FLOAT64;
  }
  cloud.point_step = 3 + 3 * size + 2;
  cloud.height = layout.height;
  cloud.width = static_cast<std::uint32_t>(points.size()) / layout.height;
  cloud.row_step = cloud.width * cloud.point_step + layout.padding;
  cloud.data.assign(std::size_t{cloud.row_step} * cloud.height, 0xAB);
  for (std::size_t i = 0; i < points.size(); ++i) {
    std::uint8_t* point =
        cloud.data.data() + i / cloud.width * cloud.row_step + i % cloud.width * cloud.point_step;
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      std::uint8_t* target = point + cloud.fields[static_cast<std::size_t>((axis + 2) % 3)].offset;
      if (layout.is_double) {
        put<double>(points[i](axis), layout.is_bigendian, target);
      } else {
        put<float>(points[i](axis), layout.is_bigendian, target);
      }
    }
  }
  return cloud;
}

TEST(FromPointCloud2, ReadsEveryLayoutAlike) {
  const std::vector<Eigen::Vector3f> points = {{1.0F, 2.0F, -3.0F},    {4.0F, -5.0F, -6.0F},
                                               {0.5F, 0.25F, -0.125F}, {7.0F, 8.0F, -9.0F},
                                               {-1.5F, 10.0F, -1e3F},  {0.0F, -0.0F, 3.14F}};
  for (const bool is_double : {false, true}) {
    for (const bool is_bigendian : {false, true}) {
      for (const std::uint32_t height : {1U, 2U, 3U, 6U}) {
        for (const std::uint32_t padding : {0U, 1U, 64U}) {
          const auto cloud = cloudLaidOut(points, {is_double, is_bigendian, height, padding});
          const rbpf_core::Ping ping = read(cloud);
          ASSERT_EQ(ping.beams_m.cols(), 6);
          for (std::size_t i = 0; i < points.size(); ++i) {
            ASSERT_EQ(Eigen::Vector3f(ping.beams_m.col(static_cast<Eigen::Index>(i))), points[i])
                << is_double << is_bigendian << height << " " << padding;
          }
        }
      }
    }
  }
}

TEST(FromPointCloud2, TakesCoordinatesOfDifferentSizes) {
  sensor_msgs::PointCloud2 cloud = goodCloud();
  cloud.fields[2].offset = 8;  // x over intensity and its own four bytes
  cloud.fields[2].datatype = PointField::FLOAT64;
  put<double>(12.5, false, cloud.data.data() + 8);
  const rbpf_core::Ping ping = read(cloud);
  EXPECT_EQ(Eigen::Vector3f(ping.beams_m.col(0)), Eigen::Vector3f(12.5F, 2.0F, -3.0F));
}

// Where rows need no step, some drivers leave it empty.
TEST(FromPointCloud2, LooksAtNoRowStepWhereTheDataArePacked) {
  for (const std::uint32_t row_step : {0U, 5U, 1000U}) {
    sensor_msgs::PointCloud2 cloud = goodCloud();
    cloud.row_step = row_step;
    EXPECT_EQ(Eigen::Vector3f(read(cloud).beams_m.col(2)), kPoints[2]);
  }
}

TEST(FromPointCloud2, LeavesNaNToTheFilter) {
  std::vector<Eigen::Vector3f> points = kPoints;
  points[1].setConstant(std::numeric_limits<float>::quiet_NaN());
  const rbpf_core::Ping ping = read(cloudOf(points));
  ASSERT_EQ(ping.beams_m.cols(), 3);
  EXPECT_TRUE(ping.beams_m.col(1).array().isNaN().all());
  EXPECT_EQ(rbpf_core::goodBeams(ping, {}, {0.0, 100.0, 0, 5.0}).cols(), 2);
}

TEST(FromPointCloud2, TakesAPingWithoutBeams) { EXPECT_EQ(read(cloudOf({})).beams_m.cols(), 0); }

TEST(FromPointCloud2, TakesItsFrameWithoutASlash) {
  sensor_msgs::PointCloud2 cloud = goodCloud();
  cloud.header.frame_id = "/mbes";
  EXPECT_EQ(fromPointCloud2(cloud).frame, "mbes");
}

TEST(FromPointCloud2, RefusesAPingWithoutAFrame) {
  sensor_msgs::PointCloud2 cloud = goodCloud();
  for (const std::string frame : {"", "/"}) {
    cloud.header.frame_id = frame;
    EXPECT_EQ(refusalOf(cloud),
              "ping's header.frame_id is '" + frame + "', expected the sensor's frame");
  }
}

TEST(FromPointCloud2, RefusesAMissingField) {
  for (const std::string name : {"x", "y", "z"}) {
    sensor_msgs::PointCloud2 cloud = goodCloud();
    for (PointField& field : cloud.fields) {
      if (field.name == name) field.name = "range";
    }
    EXPECT_TRUE(contains(refusalOf(cloud), "no field '" + name + "'")) << refusalOf(cloud);
  }
  EXPECT_FALSE(refusalOf(sensor_msgs::PointCloud2()).empty());
}

TEST(FromPointCloud2, RefusesADatatypeThatIsNoFloat) {
  sensor_msgs::PointCloud2 cloud = goodCloud();
  cloud.fields[0].datatype = PointField::INT32;
  EXPECT_TRUE(contains(refusalOf(cloud),
                       "'z' is of datatype 5 (int32), expected 7 (float32) or 8 (float64)"));
  cloud.fields[0].datatype = 77;
  EXPECT_TRUE(contains(refusalOf(cloud), "'z' is of datatype 77 (unknown), expected 7"));
}

TEST(FromPointCloud2, RefusesAFieldOfSeveralNumbers) {
  sensor_msgs::PointCloud2 cloud = goodCloud();
  cloud.fields[2].count = 0;  // as some drivers leave it
  EXPECT_EQ(refusalOf(cloud), "");
  cloud.fields[2].count = 3;
  EXPECT_TRUE(contains(refusalOf(cloud), "'x' holds 3 numbers a point, expected 1"));
}

TEST(FromPointCloud2, RefusesAFieldThatReachesBeyondItsPoint) {
  sensor_msgs::PointCloud2 cloud = goodCloud();
  cloud.fields[3].offset = 25;
  EXPECT_TRUE(contains(refusalOf(cloud), "'y' ends after point_step 28"));
  cloud.fields[3].offset = 0xFFFFFFFE;  // must not wrap round
  EXPECT_TRUE(contains(refusalOf(cloud), "'y' ends after point_step 28"));
}

TEST(FromPointCloud2, RefusesDataOfTheWrongSize) {
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

TEST(FromPointCloud2, RefusesRowsOfTheWrongSize) {
  sensor_msgs::PointCloud2 cloud = goodCloud();
  cloud.row_step = 100;  // wider than the data are
  cloud.height = 2;
  EXPECT_TRUE(contains(refusalOf(cloud), "6 points holds 84 bytes, expected 200"));
  cloud.row_step = 0xFFFFFFFF;
  cloud.height = 0xFFFFFFFF;  // must not wrap round
  EXPECT_FALSE(refusalOf(cloud).empty());
}

}  // namespace
}  // namespace rbpf_node
