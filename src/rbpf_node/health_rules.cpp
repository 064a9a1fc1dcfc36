#include "rbpf_node/health_rules.hpp"

#include <algorithm>
#include <vector>

#include "rbpf_core/decimal.hpp"

namespace rbpf_node {

namespace {

using rbpf_core::decimal;

// Of messages: turned away that lately, they are spoken of.
constexpr double kRefusedLately_s = 60.0;
// None taken in for so long, while others are turned away or wait.
constexpr double kNoneTaken_s = 5.0;
constexpr double kMostAhead_s = 0.5;
constexpr double kMostBehind_s = 5.0;

// Of map nodes, which tell how they are twice a second between their steps.
constexpr double kNodeQuiet_s = 5.0;
constexpr double kNodeSilent_s = 10.0;
constexpr double kNodesComeUp_s = 30.0;
// As often as every prompt resamples, nodes are behind at any moment, and well.
constexpr double kNodesFollow_s = 5.0;
constexpr std::size_t kNodesNamed = 3;

constexpr std::uint64_t kFailuresBeforeError = 3;
constexpr std::uint64_t kVetoesBeforeWarning = 10;

constexpr double kDiskWarn_mb = 500.0;  // as the recorder asks for at the start
constexpr double kDiskError_mb = 100.0;
constexpr double kMemoryWarn = 0.10;  // share of all
constexpr double kMemoryError = 0.03;
constexpr std::uint64_t kJournalWaits_bytes = std::uint64_t{8} << 20;

std::string counted(std::uint64_t count, const std::string& what) {
  return std::to_string(count) + " " + what + (count == 1 ? "" : "s");
}

std::string named(const std::vector<std::size_t>& nodes) {
  std::string names;
  for (std::size_t i = 0; i < nodes.size() && i < kNodesNamed; ++i) {
    names += (i == 0 ? "svgp_node_" : ", svgp_node_") + std::to_string(nodes[i]);
  }
  if (nodes.size() <= kNodesNamed) return names;
  return names + " and " + std::to_string(nodes.size() - kNodesNamed) + " more";
}

Level warnOrError(std::uint64_t failures) {
  return failures < kFailuresBeforeError ? Level::kWarn : Level::kError;
}

}  // namespace

void Verdict::add(Level of, const std::string& what) {
  if (what.empty()) return;
  if (text.empty() || (level == Level::kOk && of > Level::kOk)) {
    text = what;
  } else if (of > level) {
    text = what + "; " + text;
  } else if (of > Level::kOk || level == Level::kOk) {
    text += "; " + what;
  }
  level = std::max(level, of);
}

void Watched::look(std::uint64_t count, double now_s) {
  if (count > count_) risen_s_ = now_s;
  count_ = count;
}

std::optional<double> Watched::quietFor(double now_s) const {
  if (!risen_s_) return std::nullopt;
  return now_s - *risen_s_;
}

std::uint64_t FailuresInARow::look(std::uint64_t successes, std::uint64_t failures) {
  if (successes_ != successes) failures_before_ = failures;
  successes_ = successes;
  return failures - failures_before_;
}

// ---- odometry, pings -----------------------------------------------------------------------

Verdict StreamHealth::judge(const StreamFacts& facts, bool is_awaited, double now_s) {
  taken_.look(facts.taken, now_s);
  for (const auto& [reason, count] : facts.refused) refused_[reason].look(count, now_s);

  Verdict verdict{Level::kOk, name_ + ": coming in"};
  if (is_awaited) verdict.add(silence(facts, now_s));
  const std::string reason = refusedWithin(kRefusedLately_s, now_s);
  if (!reason.empty() && verdict.level != Level::kError) {
    verdict.add(Level::kWarn,
                name_ + ": some refused within the last minute, the last for " + reason);
  }
  if (facts.age_s < -kMostAhead_s) {
    verdict.add(Level::kWarn, name_ + ": stamped " + decimal(-facts.age_s, 1) +
                                  " s after the receipt; do clocks differ?");
  } else if (facts.age_s > kMostBehind_s) {
    verdict.add(Level::kWarn,
                name_ + ": received " + decimal(facts.age_s, 1) + " s after the stamp");
  }
  return verdict;
}

Verdict StreamHealth::silence(const StreamFacts& facts, double now_s) const {
  const std::optional<double> quiet_s = taken_.quietFor(now_s);
  if (quiet_s && *quiet_s <= kNoneTaken_s) return {};
  if (const std::string reason = refusedWithin(kNoneTaken_s, now_s); !reason.empty()) {
    return {Level::kError, name_ + ": every message is refused, the last for " + reason};
  }
  Verdict verdict;
  if (facts.waiting > 0) {
    verdict.add(Level::kWarn, name_ + ": " + counted(facts.waiting, "message") +
                                  (facts.waiting == 1 ? " waits for " : " wait for ") + waits_for_);
  }
  if (!quiet_s) {
    verdict.add(Level::kWarn, "no " + name_ + " yet");
  } else if (*quiet_s > warn_s_) {
    verdict.add(*quiet_s > error_s_ ? Level::kError : Level::kWarn,
                "no " + name_ + " for " + decimal(*quiet_s, 0) + " s");
  }
  return verdict;
}

std::string StreamHealth::refusedWithin(double seconds, double now_s) const {
  std::string latest;
  for (const auto& [reason, watched] : refused_) {
    const std::optional<double> quiet_s = watched.quietFor(now_s);
    if (!quiet_s || *quiet_s > seconds) continue;
    latest = reason;
    seconds = *quiet_s;
  }
  return latest;
}

// ---- maps ----------------------------------------------------------------------------------

Verdict judgeMaps(const MapsFacts& facts) {
  Verdict verdict{Level::kOk, std::to_string(facts.maps_ready) + " of " +
                                  std::to_string(facts.particles) + " maps are ready"};
  std::vector<std::size_t> unheard;
  std::vector<std::size_t> quiet;
  double longest_s = 0.0;
  for (std::size_t node = 0; node < facts.nodes; ++node) {
    const auto heard = facts.silent_s.find(node);
    if (heard == facts.silent_s.end()) {
      unheard.push_back(node);
    } else if (facts.is_live && heard->second > kNodeQuiet_s) {
      quiet.push_back(node);
      longest_s = std::max(longest_s, heard->second);
    }
  }
  if (!quiet.empty()) {
    verdict.add(longest_s > kNodeSilent_s ? Level::kError : Level::kWarn,
                named(quiet) + " not heard of for " + decimal(longest_s, 0) + " s");
  }
  if (!unheard.empty()) {
    verdict.add(facts.running_s > kNodesComeUp_s ? Level::kError : Level::kWarn,
                named(unheard) + " not heard of yet");
  }
  if (verdict.level == Level::kOk && facts.nodes_following < facts.nodes &&
      facts.resampled_s > kNodesFollow_s) {
    verdict.add(Level::kWarn, std::to_string(facts.nodes - facts.nodes_following) + " of " +
                                  counted(facts.nodes, "map node") +
                                  " have not followed the last resampling yet");
  }
  return verdict;
}

// ---- prompts -------------------------------------------------------------------------------

Verdict PromptHealth::judge(const PromptFacts& facts) {
  const std::uint64_t failed = failed_.look(facts.prompts, facts.failed);
  const std::uint64_t vetoed = vetoed_.look(facts.prompts, facts.vetoed);
  const std::uint64_t rolled_back = rolled_back_.look(facts.resamplings, facts.rolled_back);
  Verdict verdict{Level::kOk, facts.message};
  if (failed > 0) {
    verdict.add(warnOrError(failed), counted(failed, "prompt") +
                                         " failed since the last that did not: " + facts.message);
  }
  if (rolled_back > 0) {
    verdict.add(warnOrError(rolled_back),
                counted(rolled_back, "resampling") + " rolled back since the last that was not");
  }
  if (vetoed >= kVetoesBeforeWarning) {
    verdict.add(Level::kWarn, "the last " + counted(vetoed, "prompt") +
                                  " vetoed: no particle's map explains the seabed");
  }
  return verdict;
}

// ---- machine, journal ----------------------------------------------------------------------

Verdict judgeMachine(const MachineFacts& facts) {
  Verdict verdict{Level::kOk, "disk and memory suffice"};
  if (!facts.folder.empty() && !facts.disk_free_mb) {
    verdict.add(Level::kError, "the disk of " + facts.folder + " does not say what is free");
  } else if (!facts.folder.empty() && *facts.disk_free_mb < kDiskWarn_mb) {
    verdict.add(*facts.disk_free_mb < kDiskError_mb ? Level::kError : Level::kWarn,
                decimal(*facts.disk_free_mb, 0) + " MB are free on the disk of " + facts.folder);
  }
  if (facts.memory_available_mb && facts.memory_mb) {
    const double share = *facts.memory_available_mb / *facts.memory_mb;
    if (share < kMemoryWarn) {
      verdict.add(share < kMemoryError ? Level::kError : Level::kWarn,
                  decimal(*facts.memory_available_mb, 0) + " of " + decimal(*facts.memory_mb, 0) +
                      " MB of memory are available");
    }
  }
  return verdict;
}

Verdict judgeJournal(const JournalFacts& facts) {
  if (!facts.problem.empty()) {
    return {Level::kError, "the journal has ended: " + facts.problem};
  }
  Verdict verdict{Level::kOk, "the survey can be resumed"};
  if (facts.waiting_bytes > kJournalWaits_bytes) {
    verdict.add(Level::kWarn,
                "a slow disk: " + decimal(static_cast<double>(facts.waiting_bytes) / 1e6, 0) +
                    " MB of the journal wait for it");
  }
  return verdict;
}

}  // namespace rbpf_node
