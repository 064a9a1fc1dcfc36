#include "rbpf_node/conversions.hpp"

#include <sensor_msgs/point_cloud2_iterator.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "rbpf_core/motion_model.hpp"

namespace rbpf_node {

namespace {

void expectFrame(const std::string& what, const std::string& frame, const std::string& expected) {
  if (frame != expected) {
    throw std::invalid_argument(what + " is '" + frame + "', expected '" + expected + "'");
  }
}

void expectFloatField(const sensor_msgs::PointCloud2& message, const std::string& name) {
  const auto field = std::find_if(message.fields.begin(), message.fields.end(),
                                  [&](const auto& f) { return f.name == name; });
  if (field == message.fields.end()) {
    throw std::invalid_argument("ping has no field '" + name + "', expected float32 x y z");
  }
  if (field->datatype != sensor_msgs::PointField::FLOAT32) {
    throw std::invalid_argument("ping's field '" + name + "' is of datatype " +
                                std::to_string(field->datatype) + ", expected " +
                                std::to_string(sensor_msgs::PointField::FLOAT32) + " (float32)");
  }
  if (field->offset + sizeof(float) > message.point_step) {
    throw std::invalid_argument("ping's field '" + name + "' ends after point_step " +
                                std::to_string(message.point_step));
  }
}

void check(const sensor_msgs::PointCloud2& message) {
  for (const char* name : {"x", "y", "z"}) expectFloatField(message, name);
  const std::size_t points = std::size_t{message.width} * message.height;
  if (message.data.size() != points * message.point_step) {
    throw std::invalid_argument("ping of " + std::to_string(points) + " points holds " +
                                std::to_string(message.data.size()) + " bytes, expected " +
                                std::to_string(points * message.point_step));
  }
  if (message.is_bigendian) throw std::invalid_argument("ping is big-endian, expected little");
}

}  // namespace

Eigen::Vector3d rollPitchYaw(const Eigen::Quaterniond& rotation) {
  const Eigen::Matrix3d R = rotation.toRotationMatrix();
  return {std::atan2(R(2, 1), R(2, 2)), std::asin(std::clamp(-R(2, 0), -1.0, 1.0)),
          std::atan2(R(1, 0), R(0, 0))};
}

rbpf_core::Odometry toOdometry(const nav_msgs::Odometry& message, const Frames& frames) {
  expectFrame("odometry's header.frame_id", message.header.frame_id, frames.odom);
  expectFrame("odometry's child_frame_id", message.child_frame_id, frames.base);
  const auto& q = message.pose.pose.orientation;
  const Eigen::Quaterniond rotation(q.w, q.x, q.y, q.z);
  if (!(std::abs(rotation.norm() - 1.0) < 0.01)) {  // 1 %: messages carry rounded quaternions
    throw std::invalid_argument("odometry's orientation has the norm " +
                                std::to_string(rotation.norm()) + ", expected 1");
  }
  const Eigen::Vector3d rpy = rollPitchYaw(rotation.normalized());
  const auto& p = message.pose.pose.position;
  const auto& v = message.twist.twist.linear;
  const auto& w = message.twist.twist.angular;
  return {message.header.stamp.toSec(),
          {p.x, p.y, rpy.z()},
          {p.z, rpy.x(), rpy.y()},
          {v.x, v.y, v.z},
          {w.x, w.y, w.z}};
}

rbpf_core::Ping toPing(const sensor_msgs::PointCloud2& message,
                       const Eigen::Isometry3d& T_base_sensor) {
  check(message);
  rbpf_core::Ping ping;
  ping.stamp_s = message.header.stamp.toSec();
  ping.sensor_m = T_base_sensor.translation().cast<float>();
  ping.beams_m.resize(3, static_cast<Eigen::Index>(message.width) * message.height);
  const Eigen::Isometry3f T = T_base_sensor.cast<float>();
  sensor_msgs::PointCloud2ConstIterator<float> x(message, "x");
  sensor_msgs::PointCloud2ConstIterator<float> y(message, "y");
  sensor_msgs::PointCloud2ConstIterator<float> z(message, "z");
  for (Eigen::Index i = 0; i < ping.beams_m.cols(); ++i, ++x, ++y, ++z) {
    ping.beams_m.col(i) = T * Eigen::Vector3f(*x, *y, *z);
  }
  return ping;
}

Eigen::Isometry3d toIsometry(const rbpf_core::Pose2& pose, const rbpf_core::Attitude& attitude) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translation() << pose.x_m, pose.y_m, attitude.z_m;
  T.linear() = Eigen::AngleAxisd(pose.yaw_rad, Eigen::Vector3d::UnitZ()) *
               rbpf_core::levelRotation(attitude.roll_rad, attitude.pitch_rad);
  return T;
}

geometry_msgs::Pose toPose(const rbpf_core::Pose2& pose, const rbpf_core::Attitude& attitude) {
  const Eigen::Isometry3d T = toIsometry(pose, attitude);
  const Eigen::Quaterniond q(T.rotation());
  geometry_msgs::Pose message;
  message.position.x = pose.x_m;
  message.position.y = pose.y_m;
  message.position.z = attitude.z_m;
  message.orientation.x = q.x();
  message.orientation.y = q.y();
  message.orientation.z = q.z();
  message.orientation.w = q.w();
  return message;
}

rbpf_core::Beams placeBeams(const rbpf_core::Beams& levelled_m, const rbpf_core::Pose2& pose) {
  const auto c = static_cast<float>(std::cos(pose.yaw_rad));
  const auto s = static_cast<float>(std::sin(pose.yaw_rad));
  rbpf_core::Beams placed = levelled_m;
  placed.row(0) = c * levelled_m.row(0) - s * levelled_m.row(1);
  placed.row(1) = s * levelled_m.row(0) + c * levelled_m.row(1);
  placed.row(0).array() += static_cast<float>(pose.x_m);
  placed.row(1).array() += static_cast<float>(pose.y_m);
  return placed;
}

std::vector<float> toFloats(const std::vector<std::uint8_t>& bytes, std::size_t count,
                            const std::string& name) {
  if (bytes.size() != count * sizeof(float)) {
    throw std::invalid_argument(name + " holds " + std::to_string(bytes.size()) +
                                " bytes, expected " + std::to_string(count * sizeof(float)));
  }
  std::vector<float> values(count);
  std::memcpy(values.data(), bytes.data(), bytes.size());
  return values;
}

}  // namespace rbpf_node
