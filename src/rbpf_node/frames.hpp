// Names of the frames, after REP 105.
#pragma once

#include <string>

namespace rbpf_node {

struct Frames {
  std::string map = "map";
  std::string odom = "odom";
  std::string base = "base_link";
};

// A frame's name as tf2 knows it: tf names of old began with a slash.
inline std::string withoutSlash(const std::string& frame) {
  return frame.empty() || frame.front() != '/' ? frame : frame.substr(1);
}

}  // namespace rbpf_node
