// What a journal loses when its file is cut, damaged, or cannot be written any more.
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <csignal>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "journalled_survey.hpp"

namespace rbpf_core {
namespace {

using Existing = JournalWriter::Existing;

// A journalled survey: the file's length and the filter's state after each of its records.
class DamagedJournal : public JournalTest {
 protected:
  struct Point {
    std::uint64_t bytes;
    std::string state;
  };

  DamagedJournal() {
    ChanceSurvey chance(5);
    ParticleFilter filter(journalledParams());
    JournalWriter journal(path(), Existing::kRefuse, nullptr);
    journal.onChange(settingsOf(filter.params()));
    filter.observe(&journal);
    for (int k = 0; k < 150; ++k) {
      chance.next(&filter);
      journal.settle();
      // what changes nothing is not written down
      if (points.empty() || journal.bytes() > points.back().bytes) {
        points.push_back({journal.bytes(), stateOf(filter)});
      }
    }
    filter.observe(nullptr);
    whole = bytesOf(path());
  }

  // Of a file of these bytes.
  std::pair<ResumedSurvey, std::string> resumed(const std::string& bytes) const {
    write(path("damaged"), bytes);
    ParticleFilter filter(journalledParams());
    const ResumedSurvey survey = resumeFrom(path("damaged"), &filter);
    return {survey, stateOf(filter)};
  }

  std::vector<Point> points;
  std::string whole;
};

constexpr std::size_t kRecordsDamaged = 12;

TEST_F(DamagedJournal, LosesOfACutFileOnlyTheRecordThatIsCut) {
  ASSERT_EQ(whole.size(), points.back().bytes);
  for (std::size_t k = points.size() - kRecordsDamaged; k < points.size(); ++k) {
    const Point& before = points[k - 1];
    for (std::uint64_t size = before.bytes; size < points[k].bytes; ++size) {
      const auto [survey, state] = resumed(whole.substr(0, size));
      ASSERT_TRUE(state == before.state) << size;
      ASSERT_EQ(survey.whole_bytes, before.bytes);
      ASSERT_EQ(survey.lost_tail.has_value(), size > before.bytes);
      if (!survey.lost_tail) continue;
      ASSERT_EQ(survey.lost_tail->bytes, size - before.bytes);
      ASSERT_EQ(survey.lost_tail->records, 1U);
      ASSERT_NE(survey.lost_tail->why.find("the file ends within a record"), std::string::npos);
    }
  }
}

TEST_F(DamagedJournal, GoesOnUpToTheRecordOfWhichAByteIsWrong) {
  std::size_t counted = 0;
  for (std::size_t k = points.size() - kRecordsDamaged; k < points.size(); ++k) {
    const Point& before = points[k - 1];
    for (std::uint64_t at = before.bytes; at < points[k].bytes; ++at) {
      std::string bytes = whole;
      bytes[at] = static_cast<char>(bytes[at] ^ (1 << at % 8));
      const auto [survey, state] = resumed(bytes);
      ASSERT_TRUE(state == before.state) << at;
      ASSERT_TRUE(survey.lost_tail);
      ASSERT_EQ(survey.lost_tail->bytes, whole.size() - before.bytes);
      // those behind it are found again if its length is right
      if (survey.lost_tail->records == points.size() - k) ++counted;
    }
  }
  EXPECT_GT(counted, (whole.size() - points[points.size() - kRecordsDamaged - 1].bytes) / 2);
}

TEST_F(DamagedJournal, IsGoneOnWithInPlaceOfItsLostTail) {
  const std::uint64_t size = points.back().bytes - 3;
  write(path(), whole.substr(0, size));
  ParticleFilter filter(journalledParams());
  const ResumedSurvey survey = resumeFrom(path(), &filter);
  {
    JournalWriter journal(path(), survey.whole_bytes, nullptr);
    filter.observe(&journal);
    filter.addOdometry(turning(1e4));
    filter.observe(nullptr);
  }
  ParticleFilter again(journalledParams());
  EXPECT_FALSE(resumeFrom(path(), &again).lost_tail);
  EXPECT_TRUE(stateOf(again) == stateOf(filter));
}

// ---- disks -----------------------------------------------------------------------------------

TEST(JournalOnADisk, ThatIsFullOrNotThereIsToldAtTheStart) {
  for (const std::string path : {"/dev/full", "/proc/no_folder/survey.journal"}) {
    try {
      JournalWriter(path, Existing::kRefuse, nullptr);
      ADD_FAILURE() << path;
    } catch (const std::runtime_error& error) {
      EXPECT_NE(std::string(error.what()).find(path), std::string::npos) << error.what();
    }
  }
}

// A limit on the file's size in place of a disk's: a write is cut short, and the next one fails.
class FullDisk : public JournalTest {
 protected:
  explicit FullDisk() { signal(SIGXFSZ, SIG_IGN); }
  ~FullDisk() override { limit(RLIM_INFINITY); }

  static void limit(rlim_t bytes) {
    rlimit now{};
    getrlimit(RLIMIT_FSIZE, &now);
    now.rlim_cur = bytes == RLIM_INFINITY ? now.rlim_max : bytes;
    setrlimit(RLIMIT_FSIZE, &now);
  }
};

TEST_F(FullDisk, EndsTheJournalButNotTheSurveyAndKeepsWhatWasWritten) {
  std::vector<std::string> told;
  ParticleFilter filter(journalledParams());
  std::string state_when_full;
  {
    JournalWriter journal(path(), Existing::kRefuse,
                          [&](const std::string& why) { told.push_back(why); });
    journal.onChange(settingsOf(filter.params()));
    filter.observe(&journal);
    sail(filter, turning, 0, 20);
    journal.settle();
    state_when_full = stateOf(filter);
    limit(journal.bytes() + 10);
    sail(filter, turning, 20, 40);
    journal.settle();
    EXPECT_NE(journal.problem(), "");
    filter.observe(nullptr);
  }
  limit(RLIM_INFINITY);
  ASSERT_EQ(told.size(), 1U);
  EXPECT_NE(told[0].find(path()), std::string::npos) << told[0];
  EXPECT_NE(told[0].find("File too large"), std::string::npos) << told[0];
  EXPECT_EQ(filter.snapshot().counters().odometry_messages, 5U * 40U);
  ParticleFilter resumed(journalledParams());
  const ResumedSurvey survey = resumeFrom(path(), &resumed);
  ASSERT_TRUE(survey.lost_tail);
  EXPECT_EQ(survey.lost_tail->bytes, 10U);
  EXPECT_TRUE(stateOf(resumed) == state_when_full);
}

}  // namespace
}  // namespace rbpf_core
