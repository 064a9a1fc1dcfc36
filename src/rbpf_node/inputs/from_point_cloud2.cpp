#include "rbpf_node/inputs/from_point_cloud2.hpp"

#include <sensor_msgs/point_cloud2_iterator.h>

#include <algorithm>
#include <stdexcept>

namespace rbpf_node {

namespace {

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

PingInput fromPointCloud2(const sensor_msgs::PointCloud2& message) {
  check(message);
  PingInput input;
  input.stamp = message.header.stamp;
  input.seq = message.header.seq;
  input.frame = message.header.frame_id;
  input.beams_m.resize(3, static_cast<Eigen::Index>(message.width) * message.height);
  sensor_msgs::PointCloud2ConstIterator<float> x(message, "x");
  sensor_msgs::PointCloud2ConstIterator<float> y(message, "y");
  sensor_msgs::PointCloud2ConstIterator<float> z(message, "z");
  for (Eigen::Index i = 0; i < input.beams_m.cols(); ++i, ++x, ++y, ++z) {
    input.beams_m.col(i) << *x, *y, *z;
  }
  return input;
}

}  // namespace rbpf_node
