// Loop closing, the paper's Algorithm 2: the latest ping is predicted by every particle's map, the
// weights follow, and the particles are resampled once too few of them still count.
#pragma once

#include <atomic>
#include <cstdint>
#include <limits>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "rbpf_core/maps.hpp"
#include "rbpf_core/particle_filter.hpp"
#include "rbpf_core/resampling.hpp"
#include "rbpf_core/weighting.hpp"

namespace rbpf_core {

// Defaults are those of config/default.yaml.
struct LoopClosingParams {
  // f_LC, prompts per second of survey; 0: none.
  double rate_hz = 0.2;
  WeightingParams weighting;
  ResamplingPolicy resample_when = OnEffectiveSizeDrop{};
};

struct LoopClosingStatistics {
  // Prompts that changed the weights; that no particle's map explained; and that were not made,
  // because maps were not ready, there was too little overlap, or a node failed.
  std::uint32_t prompts = 0;
  std::uint32_t prompts_vetoed = 0;
  std::uint32_t prompts_skipped = 0;
  // Those of them that a node failed at, by this process.
  std::uint32_t prompts_failed = 0;
  // Rolled back.
  std::uint32_t resamplings_failed = 0;
  // From one node to another, so far.
  MovedMaps moved;
  // Of the last prompt, NaN before the first.
  double tempering = std::numeric_limits<double>::quiet_NaN();
  double overlap = std::numeric_limits<double>::quiet_NaN();
  // Wall time of the last prompt that changed the weights, and of the last resampling that was
  // committed.
  double prompt_s = std::numeric_limits<double>::quiet_NaN();
  double resampling_s = std::numeric_limits<double>::quiet_NaN();
  // What is being done or waited for.
  std::string message = "waiting for pings";
};

enum class StepOutcome {
  kNotDue,      // no new ping, or too soon after the last prompt
  kNotReady,    // maps are still training, or not heard of
  kFailed,      // a prediction failed; the weights are as they were
  kPrompted,    // the ping has been weighed, even if it was then found to say nothing
  kResampled,   // the same, and the resampling that followed is committed
  kRolledBack,  // the same, but that resampling failed: particles and weights are as before it
};

struct StepResult {
  StepOutcome outcome;
  // What went wrong, empty if nothing did. After a resampling that is committed: who could not be
  // told of it.
  std::string problem = {};
};

// A prompt that somebody has asked for, and what came of it.
struct AskedPrompt {
  // kNotDue: there is no ping that has not been weighed.
  StepOutcome outcome;
  // Whether the ping has changed the weights. If not, or if something went wrong: why.
  bool has_weighed = false;
  std::string why = {};
  // N_eff before it, and by its weights, before a resampling.
  double n_eff_before = 0.0;
  double n_eff_weighed = 0.0;
};

// One thread makes the steps, any thread may read. Whatever fails in the maps is in a step's
// result; nothing is thrown.
class LoopClosing {
 public:
  LoopClosing(ParticleFilter& filter, Maps& maps, LoopClosingParams params);

  // Before the first step, of a survey that goes on: where it was. epoch: resamplings committed.
  void resume(std::uint32_t epoch, const LoopClosingState& state);
  // Before the first step: is told before each prompt; null: nobody is.
  void observe(ChangeObserver* observer) { observer_ = observer; }

  // Weighs the fixes that have come, or draws the particles anew about what an operator gives,
  // whether a prompt is due or not: the N_eff rule is asked after
  // them too, as soon as maps are ready. Then
  // Algorithm 2, if the latest ping is at least 1/rate younger than the last prompt's, gaps in the
  // odometry not counted. Waits for the maps, never for the filter. To be called as often as you
  // like.
  StepResult step();
  bool isDue() const;

  // The same now, whatever the rate: but no ping is weighed twice, since it says no more the second
  // time.
  AskedPrompt promptNow();

  // The parts of a step, for callers with another rule of when they are due.
  StepResult weigh(const PlacedPing& ping);
  StepResult resample(const std::vector<std::uint32_t>& ancestors);

  // Resamplings committed.
  std::uint32_t epoch() const { return epoch_; }

  // How a resampling stands, for map nodes that may have missed its second phase: "not resampling"
  // under the old epoch means that it was rolled back, never that it has just ended well. Beams
  // placed after this has been read are of this epoch or of a later one.
  struct Progress {
    std::uint32_t epoch;
    bool resampling;
  };
  Progress progress() const;

  LoopClosingStatistics statistics() const;

 private:
  void tellObserver();
  void weighFixes();
  StepResult prompt();
  StepResult resampleIfDue(const StepResult& otherwise);
  // A stamp on a clock that stands still in gaps.
  double surveySecondsOf(double stamp_s) const;
  std::string whyNotReady() const;
  StepResult commit(std::uint32_t epoch);
  StepResult rollBack(std::uint32_t epoch, const std::string& why);
  template <typename Change>
  void note(const Change& change);
  void skip(const std::string& why);

  ParticleFilter& filter_;
  Maps& maps_;
  const LoopClosingParams params_;
  std::atomic<std::uint32_t> epoch_{0};
  std::atomic<bool> resampling_{false};
  ChangeObserver* observer_ = nullptr;
  // Fixes have been weighed since the N_eff rule was asked.
  bool fixes_weighed_ = false;
  // The last ping that has changed the weights.
  std::optional<std::uint32_t> last_weighed_;
  // Survey seconds of the last prompt's ping.
  double last_prompt_s_ = -std::numeric_limits<double>::infinity();
  mutable std::mutex mutex_;  // guards statistics_
  LoopClosingStatistics statistics_;
};

}  // namespace rbpf_core
