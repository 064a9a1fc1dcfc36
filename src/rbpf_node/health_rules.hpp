// When something is wrong with a survey under way: the rules of /diagnostics, which
// docs/reliability.md states. No ROS; times are of a steady clock, since a bag's may stand still.
#pragma once

#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <utility>

namespace rbpf_node {

// With the numbers of diagnostic_msgs/DiagnosticStatus.
enum class Level : std::uint8_t { kOk = 0, kWarn = 1, kError = 2 };

struct Verdict {
  Level level = Level::kOk;
  std::string text;

  // One more thing to say, if it is not empty. The worst comes first; what is fine is left out
  // beside what is not.
  void add(Level of, const std::string& what);
  void add(const Verdict& other) { add(other.level, other.text); }
};

// A count that somebody looks at now and then.
class Watched {
 public:
  void look(std::uint64_t count, double now_s);

  std::uint64_t count() const { return count_; }
  // s since it last rose; nothing if it never has.
  std::optional<double> quietFor(double now_s) const;

 private:
  std::uint64_t count_ = 0;
  std::optional<double> risen_s_;
};

// Failures since the last success, or since somebody looked first.
class FailuresInARow {
 public:
  std::uint64_t look(std::uint64_t successes, std::uint64_t failures);

 private:
  std::optional<std::uint64_t> successes_;
  std::uint64_t failures_before_ = 0;
};

// ---- odometry, pings -----------------------------------------------------------------------

struct StreamFacts {
  // Messages, since the survey's start.
  std::uint64_t taken = 0;
  std::map<std::string, std::uint64_t> refused;  // by reason
  // That have come and are not taken in yet.
  std::uint64_t waiting = 0;
  // s from the stamp of the last one that passed the gate to its receipt; NaN before the first.
  double age_s = std::numeric_limits<double>::quiet_NaN();
};

class StreamHealth {
 public:
  // name: as in "no pings for 12 s"; waits_for: as in "3 messages wait for odometry"; how long
  // silence may last.
  StreamHealth(std::string name, std::string waits_for, double warn_s, double error_s)
      : name_(std::move(name)),
        waits_for_(std::move(waits_for)),
        warn_s_(warn_s),
        error_s_(error_s) {}

  // is_awaited: silence means something, as it does not after the survey's end.
  Verdict judge(const StreamFacts& facts, bool is_awaited, double now_s);

 private:
  Verdict silence(const StreamFacts& facts, double now_s) const;
  // The reason that has turned a message away last, if that was not long ago.
  std::string refusedWithin(double seconds, double now_s) const;

  const std::string name_;
  const std::string waits_for_;
  const double warn_s_;
  const double error_s_;
  Watched taken_;
  std::map<std::string, Watched> refused_;
};

// ---- the rest ------------------------------------------------------------------------------

struct MapsFacts {
  std::size_t nodes = 0;
  // s since each node that has ever reported did so last.
  std::map<std::size_t, double> silent_s;
  // That are at the resampling at which the filter is.
  std::size_t nodes_following = 0;
  std::size_t particles = 0;
  std::size_t maps_ready = 0;
  // s since the filter resampled last, or since the core's start.
  double resampled_s = 0.0;
  // s since the core's start.
  double running_s = 0.0;
  // In an offline replay nodes report in their turns: their silence means nothing.
  bool is_live = true;
};

Verdict judgeMaps(const MapsFacts& facts);

struct PromptFacts {
  std::uint64_t prompts = 0;
  std::uint64_t vetoed = 0;
  std::uint64_t failed = 0;
  std::uint64_t resamplings = 0;
  std::uint64_t rolled_back = 0;
  // What loop closing is doing.
  std::string message;
};

class PromptHealth {
 public:
  Verdict judge(const PromptFacts& facts);

 private:
  FailuresInARow failed_;
  FailuresInARow vetoed_;
  FailuresInARow rolled_back_;
};

struct MachineFacts {
  // Of the journal and its disk; empty, and not looked at, where no journal is kept.
  std::string folder;
  // Nothing where the system does not say.
  std::optional<double> disk_free_mb;
  std::optional<double> memory_available_mb;
  std::optional<double> memory_mb;
};

Verdict judgeMachine(const MachineFacts& facts);

struct JournalFacts {
  // Why it has ended before its time.
  std::string problem;
  // That the disk has not taken yet.
  std::uint64_t waiting_bytes = 0;
};

Verdict judgeJournal(const JournalFacts& facts);

}  // namespace rbpf_node
