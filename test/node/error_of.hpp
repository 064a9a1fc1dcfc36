// What a call throws.
#pragma once

#include <optional>
#include <stdexcept>
#include <string>

#include "rbpf_core/refusal.hpp"

namespace rbpf_node {

// The text of its std::invalid_argument; empty if it throws none.
template <typename Call>
std::string errorOf(const Call& call) {
  try {
    call();
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

// Why a call refuses a message; nothing if it does not.
template <typename Call>
std::optional<rbpf_core::Reason> reasonOf(const Call& call) {
  try {
    call();
  } catch (const rbpf_core::Refusal& refusal) {
    return refusal.reason();
  }
  return std::nullopt;
}

inline bool contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

}  // namespace rbpf_node
