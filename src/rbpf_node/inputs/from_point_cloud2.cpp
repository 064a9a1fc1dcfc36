#include "rbpf_node/inputs/from_point_cloud2.hpp"

#include <algorithm>
#include <array>
#include <cstring>
#include <string>

#include "rbpf_core/refusal.hpp"

namespace rbpf_node {

namespace {

using sensor_msgs::PointCloud2;
using sensor_msgs::PointField;

constexpr const char* kExpected = "expected x y z of float32 or float64";

const char* nameOf(std::uint8_t datatype) {
  constexpr std::array<const char*, 9> kNames = {"none",  "int8",   "uint8",   "int16",  "uint16",
                                                 "int32", "uint32", "float32", "float64"};
  return datatype < kNames.size() ? kNames[datatype] : "unknown";
}

[[noreturn]] void fail(const std::string& what) {
  throw rbpf_core::Refusal(rbpf_core::Reason::kMalformed, "ping" + what);
}

// Where one coordinate stands in each point.
struct Column {
  std::size_t offset;
  bool is_double;
  bool is_foreign;  // of the other byte order

  float of(const std::uint8_t* point) const {
    // metres from the sensor: float32 is fine enough
    return is_double ? static_cast<float>(value<double>(point)) : value<float>(point);
  }

 private:
  template <typename Number>
  Number value(const std::uint8_t* point) const {
    std::array<std::uint8_t, sizeof(Number)> bytes;
    std::copy_n(point + offset, bytes.size(), bytes.begin());
    if (is_foreign) std::reverse(bytes.begin(), bytes.end());
    Number number;
    std::memcpy(&number, bytes.data(), bytes.size());
    return number;
  }
};

Column columnOf(const PointCloud2& message, const std::string& name) {
  const auto field = std::find_if(message.fields.begin(), message.fields.end(),
                                  [&](const auto& f) { return f.name == name; });
  if (field == message.fields.end()) fail(" has no field '" + name + "', " + kExpected);
  const bool is_double = field->datatype == PointField::FLOAT64;
  if (!is_double && field->datatype != PointField::FLOAT32) {
    fail("'s field '" + name + "' is of datatype " + std::to_string(field->datatype) + " (" +
         nameOf(field->datatype) + "), expected 7 (float32) or 8 (float64)");
  }
  // 0 is what some drivers leave it at
  if (field->count > 1) {
    fail("'s field '" + name + "' holds " + std::to_string(field->count) +
         " numbers a point, expected 1");
  }
  const std::size_t size = is_double ? sizeof(double) : sizeof(float);
  if (field->offset + size > message.point_step) {
    fail("'s field '" + name + "' ends after point_step " + std::to_string(message.point_step));
  }
  static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "what is foreign is big-endian");
  return {field->offset, is_double, message.is_bigendian != 0};
}

// Bytes from one row to the next. Rows may be padded; where the data are packed row_step is not
// looked at, for some drivers leave it empty.
std::size_t rowStep(const PointCloud2& message) {
  const std::size_t points = std::size_t{message.width} * message.height;
  const std::size_t packed_row = std::size_t{message.width} * message.point_step;
  const std::size_t bytes = message.data.size();
  // divided, not multiplied: must not wrap round
  const bool too_many = points > bytes / message.point_step;
  if (!too_many && bytes == points * message.point_step) return packed_row;
  const bool is_padded = message.row_step > packed_row;
  if (is_padded && message.height <= bytes / message.row_step &&
      bytes == std::size_t{message.row_step} * message.height) {
    return message.row_step;
  }
  fail(" of " + std::to_string(points) + " points holds " + std::to_string(bytes) +
       " bytes, expected " +
       std::to_string(is_padded ? std::size_t{message.row_step} * message.height
                                : points * message.point_step));
}

}  // namespace

PingInput fromPointCloud2(const PointCloud2& message) {
  const Column x = columnOf(message, "x");
  const Column y = columnOf(message, "y");
  const Column z = columnOf(message, "z");
  const std::size_t row_step = rowStep(message);
  PingInput input = pingOf(message.header);
  input.beams_m.resize(3, static_cast<Eigen::Index>(message.width) * message.height);
  Eigen::Index beam = 0;
  // rows without a point have no bytes, and can be four billion: only an optimiser passes over them
  const std::size_t rows = message.width == 0 ? 0 : message.height;
  for (std::size_t row = 0; row < rows; ++row) {
    const std::uint8_t* point = message.data.data() + row * row_step;
    for (std::size_t i = 0; i < message.width; ++i, point += message.point_step) {
      input.beams_m.col(beam++) << x.of(point), y.of(point), z.of(point);
    }
  }
  return input;
}

}  // namespace rbpf_node
