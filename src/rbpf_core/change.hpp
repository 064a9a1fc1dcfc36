// Everything that changes a survey's state. The filter is deterministic: its parameters and these,
// in their order, are its state.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "rbpf_core/fix.hpp"
#include "rbpf_core/known_error.hpp"
#include "rbpf_core/past_correction.hpp"
#include "rbpf_core/types.hpp"

namespace rbpf_core {

// What the filter has been told before it started: a line `name value` for each of its parameters.
struct FilterSettings {
  std::string text;
};
// What all of the program has been told, in whatever words, and the number by which map nodes know
// the survey. A program that is not the first one has the filter go on.
struct ProgramSettings {
  std::uint64_t survey = 0;
  std::string text;
};

// The arguments of ParticleFilter::keepOdometrySince, setLogWeights, resample and drawAnew.
struct OdometryKept {
  std::optional<double> since_s;
};
struct WeightsSet {
  Eigen::ArrayXd log_weights;
};
struct Resampled {
  std::vector<std::uint32_t> ancestors;
};
struct DrawnAnew {
  Fix given;
  std::vector<Pose2> at;
};
// Calls of takeFixesToWeigh that have taken some, and of finish.
struct FixesTaken {};
struct SurveyFinished {};

// What loop closing goes by; resamplings are counted by themselves.
struct LoopClosingState {
  // Survey seconds of the last prompt's ping.
  double last_prompt_s = -std::numeric_limits<double>::infinity();
  // As in LoopClosingStatistics.
  std::uint32_t prompts = 0;
  std::uint32_t prompts_vetoed = 0;
  std::uint32_t prompts_skipped = 0;
  std::uint32_t resamplings_failed = 0;
  std::uint32_t maps_moved = 0;
  std::uint64_t bytes_moved = 0;
};

// Odometry, pings and fixes as they were handed to the filter, those that it refused too. A
// journal's records have the numbers of this order: others come at its end.
using Change = std::variant<FilterSettings, ProgramSettings, Odometry, Ping, Fix, OdometryKept,
                            WeightsSet, Resampled, DrawnAnew, PastCorrection, KnownError,
                            FixesTaken, SurveyFinished, LoopClosingState>;

class ChangeObserver {
 public:
  virtual ~ChangeObserver() = default;

  // In the order in which the filter changes, and while it is locked: to be quick, and not to call
  // the filter.
  virtual void onChange(const Change& change) = 0;

  // Before anybody else hears of what has changed: may wait for a moment until it is kept.
  virtual void settle() = 0;
};

}  // namespace rbpf_core
