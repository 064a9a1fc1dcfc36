// Messages that are not taken in: why, and how many.
#pragma once

#include <cstdint>
#include <map>
#include <stdexcept>
#include <string>
#include <utility>

#include "rbpf_core/input_kind.hpp"

namespace rbpf_core {

enum class Reason {
  // something is wrong with the message
  kWrongType,
  kMalformed,
  kNoStamp,
  kWrongFrame,
  kNotFinite,
  kDuplicateStamp,
  kOutOfOrder,
  kNoBeams,
  kClockAhead,
  kClockBehind,
  kImplausibleTwist,
  kImplausiblePose,
  kImplausibleMount,
  kNoFix,
  kContradicts,
  // nothing is, but the node cannot use it
  kNoMount,
  kNoOrigin,
  kNoOdometry,
  kInGap,
  kQueueFull,
  kMappingPaused,
  kSurveyOver,
};

// For machines: "pings/no_mount", "odometry/out_of_order", "fixes/contradicts".
std::string nameOf(InputKind kind, Reason reason);

// What is wrong with a message, the value, and what was expected.
class Refusal : public std::invalid_argument {
 public:
  Refusal(Reason reason, const std::string& what) : std::invalid_argument(what), reason_(reason) {}

  Reason reason() const { return reason_; }

 private:
  Reason reason_;
};

class RefusalCounts {
 public:
  struct Count {
    std::uint64_t messages = 0;
    // what was wrong with the first
    std::string example;
  };
  using Counts = std::map<std::pair<InputKind, Reason>, Count>;

  // Returns true if these are the first of their kind for this reason.
  bool add(InputKind kind, Reason reason, const std::string& what, std::uint64_t messages = 1);
  void add(const RefusalCounts& others);

  const Counts& counts() const { return counts_; }
  std::uint64_t total() const;

  // Messages of a kind with which something was wrong, and those with which nothing was.
  std::uint64_t rejected(InputKind kind) const;
  std::uint64_t dropped(InputKind kind) const;

 private:
  Counts counts_;
};

}  // namespace rbpf_core
