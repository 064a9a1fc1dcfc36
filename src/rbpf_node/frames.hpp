// Names of the frames, after REP 105.
#pragma once

#include <string>

namespace rbpf_node {

struct Frames {
  std::string map = "map";
  std::string odom = "odom";
  std::string base = "base_link";
};

}  // namespace rbpf_node
