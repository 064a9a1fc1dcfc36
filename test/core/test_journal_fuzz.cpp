// Whatever a journal's bytes are, it is read as far as it makes sense, or refused by an exception.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "journalled_survey.hpp"
#include "mutations.hpp"
#include "rbpf_core/journal/change_bytes.hpp"
#include "rbpf_core/journal/journal_format.hpp"

namespace rbpf_core {
namespace {

class FuzzedJournal : public JournalTest {
 protected:
  FuzzedJournal() {
    ChanceSurvey chance(6);
    ParticleFilter filter(journalledParams());
    {
      JournalWriter journal(path(), JournalWriter::Existing::kRefuse, nullptr);
      journal.onChange(settingsOf(filter.params()));
      journal.onChange(ProgramSettings{77, "all of them"});
      filter.observe(&journal);
      for (int k = 0; k < 120; ++k) chance.next(&filter);
      filter.observe(nullptr);
    }
    const std::string bytes = bytesOf(path());
    whole.assign(bytes.begin(), bytes.end());
    JournalReader reader(path());
    while (const auto change = reader.next()) changes.push_back(*change);
  }

  // The filter is still one with which a survey can go on, or an exception says why not.
  void resume(const std::vector<std::uint8_t>& bytes) {
    write(path("fuzzed"), {bytes.begin(), bytes.end()});
    ParticleFilter filter(journalledParams());
    try {
      const ResumedSurvey survey = resumeFrom(path("fuzzed"), &filter);
      ASSERT_LE(survey.whole_bytes, bytes.size());
    } catch (const std::runtime_error&) {
      ++refused;
      return;
    }
    ++resumed;
    ASSERT_TRUE(filter.snapshot().logWeights().allFinite());
    filter.finish();
  }

  std::vector<std::uint8_t> whole;
  std::vector<Change> changes;
  std::size_t resumed = 0;
  std::size_t refused = 0;
};

TEST_F(FuzzedJournal, OfDamagedBytesIsResumedOrRefused) {
  forManySeeds(300, [&](std::uint32_t seed) { resume(Mutations(seed).of(whole)); });
  EXPECT_GT(resumed, 100U);
  EXPECT_GT(refused, 2U);
}

// A stranger can make checksums, too.
TEST_F(FuzzedJournal, OfForgedRecordsIsResumedOrRefused) {
  forManySeeds(600, [&](std::uint32_t seed) {
    Mutations mutations(seed);
    std::vector<std::uint8_t> bytes = journal_format::fileHead();
    const std::size_t forged = 1 + mutations.below(changes.size() - 1);
    for (std::size_t k = 0; k < changes.size(); ++k) {
      Change change = changes[k];
      if (k == forged) {
        try {
          change = toChange(change.index(), mutations.of(toBytes(change)));
        } catch (const std::invalid_argument&) {
          // of another length: as a record whose checksum does not agree
        }
      }
      const std::vector<std::uint8_t> record = journal_format::toRecord(change);
      bytes.insert(bytes.end(), record.begin(), record.end());
    }
    resume(bytes);
  });
  EXPECT_GT(resumed, 300U);
  EXPECT_GT(refused, 0U);
}

TEST_F(FuzzedJournal, HasChangesOfWhichNoBytesMakeMoreThanTheyHold) {
  forManySeeds(8000, [&](std::uint32_t seed) {
    Mutations mutations(seed);
    const Change& change = changes[mutations.below(changes.size())];
    const std::size_t type = mutations.below(4) == 0 ? mutations.below(256) : change.index();
    const std::vector<std::uint8_t> bytes = mutations.of(toBytes(change));
    try {
      const Change read = toChange(type, bytes);
      ASSERT_EQ(toBytes(read).size(), bytes.size());
    } catch (const std::invalid_argument&) {
    }
  });
}

}  // namespace
}  // namespace rbpf_core
