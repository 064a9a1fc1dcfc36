// A journal of whatever bytes, and what becomes of the survey that goes on from it.
#pragma once

#include <cmath>
#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include "../fuzz/promise.hpp"
#include "journalled_survey.hpp"
#include "rbpf_core/journal/journal_format.hpp"

namespace rbpf_core {

// The journal of a survey in which so many things happen.
inline std::vector<std::uint8_t> wholeJournal(int changes) {
  const JournalFolder folder;
  ChanceSurvey chance(6);
  ParticleFilter filter(journalledParams());
  {
    JournalWriter journal(folder.path(), JournalWriter::Existing::kRefuse, nullptr);
    journal.onChange(settingsOf(filter.params()));
    journal.onChange(ProgramSettings{77, "all of them"});
    filter.observe(&journal);
    for (int k = 0; k < changes; ++k) chance.next(&filter);
    filter.observe(nullptr);
  }
  const std::string bytes = JournalFolder::bytesOf(folder.path());
  return {bytes.begin(), bytes.end()};
}

// With the right checksum behind each record: a stranger can make them, too.
inline std::vector<std::uint8_t> withRightChecksums(std::vector<std::uint8_t> bytes) {
  using namespace journal_format;
  std::size_t at = kFileHeadBytes;
  while (bytes.size() >= at + kRecordHeadBytes + kChecksumBytes) {
    const std::size_t size = kRecordHeadBytes + numberAt<std::uint32_t>(bytes.data() + at);
    if (size > bytes.size() - at - kChecksumBytes) break;
    const std::uint32_t sum = checksum(bytes.data() + at, size);
    std::memcpy(bytes.data() + at + size, &sum, sizeof(sum));
    at += size + kChecksumBytes;
  }
  return bytes;
}

// Does what recover_run.py and a core that resumes do: the filter is then one with which a survey
// can go on. Otherwise it was refused, by std::runtime_error.
inline bool isResumed(const std::string& path) {
  try {
    ParticleFilter filter(paramsIn(path));
    const ResumedSurvey survey = resumeFrom(path, &filter);
    promise(survey.whole_bytes <= std::filesystem::file_size(path), "no more than there is");
    promise(filter.snapshot().logWeights().allFinite(), "weights are finite");
    stateOf(filter);
    filter.finish();
  } catch (const std::runtime_error&) {
    return false;
  }
  return true;
}

}  // namespace rbpf_core
