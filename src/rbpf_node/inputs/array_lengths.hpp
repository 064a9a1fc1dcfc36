// The lengths that a message's arrays announce, looked at before roscpp makes room for them: a few
// bytes can announce gigabytes.
#pragma once

#include <sensor_msgs/LaserScan.h>
#include <sensor_msgs/PointCloud2.h>

#include <cstdint>
#include <cstring>
#include <vector>

namespace rbpf_node {

// Walks over a message as it is on the wire. Once something would end after the bytes, nothing
// fits any more.
class Walk {
 public:
  explicit Walk(const std::vector<std::uint8_t>& bytes) : bytes_(bytes) {}

  bool fits() const { return fits_; }
  void skip(std::uint64_t bytes) {
    fits_ = fits_ && bytes <= bytes_.size() - at_;
    if (fits_) at_ += bytes;
  }
  // each: bytes of an element, or what it has at least.
  std::uint32_t array(std::uint64_t each) {
    std::uint32_t length = 0;
    const std::size_t from = at_;
    skip(sizeof(length));
    if (fits_) std::memcpy(&length, bytes_.data() + from, sizeof(length));
    fits_ = fits_ && length <= (bytes_.size() - at_) / each;
    return fits_ ? length : 0;
  }
  void text() { skip(array(1)); }
  void header() {
    skip(12);  // seq, stamp
    text();    // frame_id
  }

 private:
  const std::vector<std::uint8_t>& bytes_;
  std::size_t at_ = 0;
  bool fits_ = true;
};

// Whether the arrays of a message can be as long as they say. Most messages have none.
template <typename Message>
bool arraysFit(const std::vector<std::uint8_t>&) {
  return true;
}

template <>
inline bool arraysFit<sensor_msgs::PointCloud2>(const std::vector<std::uint8_t>& bytes) {
  Walk walk(bytes);
  walk.header();
  walk.skip(8);  // height, width
  const std::uint32_t fields = walk.array(13);
  for (std::uint32_t i = 0; i < fields && walk.fits(); ++i) {
    walk.text();
    walk.skip(9);  // offset, datatype, count
  }
  walk.skip(9);  // is_bigendian, point_step, row_step
  walk.skip(walk.array(1));
  return walk.fits();
}

template <>
inline bool arraysFit<sensor_msgs::LaserScan>(const std::vector<std::uint8_t>& bytes) {
  Walk walk(bytes);
  walk.header();
  walk.skip(28);  // seven numbers
  walk.skip(4 * std::uint64_t{walk.array(4)});
  walk.array(4);
  return walk.fits();
}

}  // namespace rbpf_node
