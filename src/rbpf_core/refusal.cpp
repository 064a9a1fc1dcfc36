#include "rbpf_core/refusal.hpp"

#include <algorithm>

namespace rbpf_core {

namespace {

const char* nameOf(Reason reason) {
  switch (reason) {
    case Reason::kWrongType:
      return "wrong_type";
    case Reason::kMalformed:
      return "malformed";
    case Reason::kNoStamp:
      return "no_stamp";
    case Reason::kWrongFrame:
      return "wrong_frame";
    case Reason::kNotFinite:
      return "not_finite";
    case Reason::kDuplicateStamp:
      return "duplicate_stamp";
    case Reason::kOutOfOrder:
      return "out_of_order";
    case Reason::kNoBeams:
      return "no_beams";
    case Reason::kClockAhead:
      return "clock_ahead";
    case Reason::kClockBehind:
      return "clock_behind";
    case Reason::kImplausibleTwist:
      return "implausible_twist";
    case Reason::kImplausiblePose:
      return "implausible_pose";
    case Reason::kImplausibleMount:
      return "implausible_mount";
    case Reason::kNoFix:
      return "no_fix";
    case Reason::kContradicts:
      return "contradicts";
    case Reason::kNoMount:
      return "no_mount";
    case Reason::kNoOrigin:
      return "no_origin";
    case Reason::kNoOdometry:
      return "no_odometry";
    case Reason::kInGap:
      return "in_gap";
    case Reason::kQueueFull:
      return "queue_full";
    case Reason::kMappingPaused:
      return "mapping_paused";
    case Reason::kSurveyOver:
      return "survey_over";
  }
  throw std::logic_error("a reason without a name");
}

const char* groupOf(InputKind kind) {
  switch (kind) {
    case InputKind::kOdometry:
      return "odometry/";
    case InputKind::kPing:
      return "pings/";
    case InputKind::kFix:
      return "fixes/";
  }
  throw std::logic_error("a kind without a name");
}

// A text may quote a damaged message; not all that reads it stands bytes that are no text.
std::string printable(std::string text) {
  std::replace_if(
      text.begin(), text.end(), [](char c) { return c < ' ' || c > '~'; }, '?');
  return text;
}

}  // namespace

std::string nameOf(InputKind kind, Reason reason) {
  return groupOf(kind) + std::string(nameOf(reason));
}

bool RefusalCounts::add(InputKind kind, Reason reason, const std::string& what,
                        std::uint64_t messages) {
  if (messages == 0) return false;
  Count& count = counts_[{kind, reason}];
  const bool are_first = count.messages == 0;
  if (are_first) count.example = printable(what);
  count.messages += messages;
  return are_first;
}

void RefusalCounts::add(const RefusalCounts& others) {
  for (const auto& [what, count] : others.counts_) {
    add(what.first, what.second, count.example, count.messages);
  }
}

std::uint64_t RefusalCounts::total() const {
  std::uint64_t messages = 0;
  for (const auto& [what, count] : counts_) messages += count.messages;
  return messages;
}

std::uint64_t RefusalCounts::rejected(InputKind kind) const {
  std::uint64_t messages = 0;
  for (const auto& [what, count] : counts_) {
    if (what.first == kind && what.second < Reason::kNoMount) messages += count.messages;
  }
  return messages;
}

std::uint64_t RefusalCounts::dropped(InputKind kind) const {
  std::uint64_t messages = 0;
  for (const auto& [what, count] : counts_) {
    if (what.first == kind && what.second >= Reason::kNoMount) messages += count.messages;
  }
  return messages;
}

}  // namespace rbpf_core
