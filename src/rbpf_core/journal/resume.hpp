// A survey from its journal: everything that has changed it, done once more.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "rbpf_core/journal/journal_reader.hpp"
#include "rbpf_core/particle_filter.hpp"

namespace rbpf_core {

// What a journal holds besides the filter's state.
struct ResumedSurvey {
  // Resamplings committed.
  std::uint32_t epoch = 0;
  LoopClosingState loop_closing;
  std::size_t records = 0;
  // Programs that have written it, one after the other.
  std::uint32_t programs = 0;
  // Of the file, up to where it can go on.
  std::uint64_t whole_bytes = 0;
  std::optional<LostTail> lost_tail;
  // Of the program, as they last were.
  ProgramSettings settings;
};

// What the filter of a journal was told before it started. Throws std::runtime_error as resumeFrom
// does.
FilterParams paramsIn(const std::string& path);

// The number by which map nodes know the survey of a journal. Throws std::runtime_error as
// resumeFrom does.
std::uint64_t surveyIn(const std::string& path);

// Brings a new filter to where the journal ends, bit for bit. Throws std::runtime_error that names
// what is wrong: see JournalReader and expectSameSettings; and if a record is none that this filter
// can have written.
ResumedSurvey resumeFrom(const std::string& path, ParticleFilter* filter);

}  // namespace rbpf_core
