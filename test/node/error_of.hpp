// The text of the std::invalid_argument that a call throws; empty if it throws none.
#pragma once

#include <stdexcept>
#include <string>

namespace rbpf_node {

template <typename Call>
std::string errorOf(const Call& call) {
  try {
    call();
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

inline bool contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

}  // namespace rbpf_node
