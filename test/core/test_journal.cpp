// A survey that goes on from its journal is the one that was interrupted, bit for bit.
#include <gtest/gtest.h>

#include <atomic>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "journalled_survey.hpp"
#include "rbpf_core/journal/change_bytes.hpp"

namespace rbpf_core {
namespace {

using Existing = JournalWriter::Existing;

// Begins a journal, and has the filter write it.
std::unique_ptr<JournalWriter> journalOf(ParticleFilter* filter, const std::string& path) {
  auto journal = std::make_unique<JournalWriter>(path, Existing::kRefuse, nullptr);
  journal->onChange(settingsOf(filter->params()));
  filter->observe(journal.get());
  return journal;
}

std::string problemOf(const std::string& path, const FilterParams& params) {
  ParticleFilter filter(params);
  try {
    resumeFrom(path, &filter);
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "";
}

// ---- resuming ------------------------------------------------------------------------------

class ResumedSurveys : public JournalTest, public testing::WithParamInterface<unsigned> {};

TEST_P(ResumedSurveys, AreTheOnesThatWereInterruptedAndGoOnAlike) {
  ChanceSurvey chance(GetParam());
  ParticleFilter filter(journalledParams());
  {
    const auto journal = journalOf(&filter, path());
    for (int k = 0; k < 600; ++k) chance.next(&filter);
    filter.observe(nullptr);
  }
  ParticleFilter resumed(journalledParams());
  const ResumedSurvey survey = resumeFrom(path(), &resumed);
  EXPECT_FALSE(survey.lost_tail);
  EXPECT_EQ(survey.whole_bytes, std::filesystem::file_size(path()));
  EXPECT_EQ(stateOf(resumed), stateOf(filter));
  ASSERT_GT(filter.snapshot().pings(), 50U);
  ASSERT_GT(filter.snapshot().past(), 0U);
  ASSERT_GT(filter.snapshot().fixes(), 0U);
  // also what nobody sees: random numbers, what waits, odometry that is kept
  ChanceSurvey same = chance;
  for (int k = 0; k < 200; ++k) {
    chance.next(&filter);
    same.next(&resumed);
  }
  filter.finish();
  resumed.finish();
  EXPECT_EQ(stateOf(resumed), stateOf(filter));
  EXPECT_EQ(resumed.takeFixesToWeigh().size(), filter.takeFixesToWeigh().size());
}

INSTANTIATE_TEST_SUITE_P(Seeds, ResumedSurveys, testing::Values(1U, 2U, 3U));

class Journal : public JournalTest {};

TEST_F(Journal, GoesOnInTheSameFileAsOftenAsTheSurveyIsInterrupted) {
  ChanceSurvey chance(4);
  ChanceSurvey same(4);
  ParticleFilter uninterrupted(journalledParams());
  for (int part = 0; part < 4; ++part) {
    ParticleFilter filter(journalledParams());
    std::unique_ptr<JournalWriter> journal;
    if (part == 0) {
      journal = journalOf(&filter, path());
    } else {
      const ResumedSurvey survey = resumeFrom(path(), &filter);
      journal = std::make_unique<JournalWriter>(path(), survey.whole_bytes, nullptr);
      filter.observe(journal.get());
    }
    for (int k = 0; k < 100; ++k) {
      chance.next(&filter);
      same.next(&uninterrupted);
    }
    filter.observe(nullptr);
    EXPECT_EQ(stateOf(filter), stateOf(uninterrupted)) << part;
  }
}

// As with resume:=DIR, whether the survey has been finished or not.
TEST_F(Journal, GoesOnAfterTheSurveysEnd) {
  ParticleFilter filter(journalledParams());
  {
    const auto journal = journalOf(&filter, path());
    journal->onChange(ProgramSettings{7, "the first program"});
    sail(filter, turning, 0, 5);
    filter.finish();
    journal->onChange(ProgramSettings{7, "the second program"});
    filter.goOn();
    sail(filter, turning, 5, 10);
    filter.observe(nullptr);
  }
  EXPECT_EQ(filter.snapshot().refused().dropped(InputKind::kPing), 0U);
  ParticleFilter resumed(journalledParams());
  EXPECT_EQ(resumeFrom(path(), &resumed).programs, 2U);
  EXPECT_EQ(stateOf(resumed), stateOf(filter));
}

// The order is that of the changes, whichever thread makes them.
TEST_F(Journal, HasTheOrderInWhichThreadsHaveChangedTheFilter) {
  ParticleFilter filter(journalledParams());
  {
    const auto journal = journalOf(&filter, path());
    sail(filter, turning, 0, 5);
    std::atomic<bool> stop{false};
    std::atomic<int> decided{0};
    std::thread decides([&] {
      for (; !stop; ++decided) {
        Eigen::ArrayXd weights = Eigen::ArrayXd::LinSpaced(6, 1.0, 2.0 + decided % 3);
        filter.setLogWeights((weights / weights.sum()).log());
        if (decided % 5 == 0) filter.resample({0, 1, 1, 3, 4, 5});
        if (decided % 7 != 0) continue;
        PastCorrection correction;
        correction.of_rest = {0.01, -0.02, 0.001};
        correction.of_pings = {{0, correction.of_rest}, {filter.snapshot().pings() - 1, {}}};
        filter.correctPast(correction);
      }
    });
    for (int s = 5; s < 300; ++s) {
      sail(filter, turning, s, s + 1);
      while (decided < (s - 4) / 2) std::this_thread::yield();  // neither gets far ahead
    }
    stop = true;
    decides.join();
    filter.observe(nullptr);
    ASSERT_GE(decided, 100);
  }
  ParticleFilter resumed(journalledParams());
  resumeFrom(path(), &resumed);
  EXPECT_TRUE(stateOf(resumed) == stateOf(filter));
}

TEST_F(Journal, KeepsWhereLoopClosingWas) {
  ParticleFilter filter(journalledParams());
  {
    const auto journal = journalOf(&filter, path());
    sail(filter, turning, 0, 5);
    filter.resample({0, 1, 1, 3, 4, 5});
    journal->onChange(LoopClosingState{3.5, 7, 1, 2, 3, 4, 5});
    journal->onChange(ProgramSettings{77, "all of them"});
    filter.observe(nullptr);
  }
  ParticleFilter resumed(journalledParams());
  const ResumedSurvey survey = resumeFrom(path(), &resumed);
  EXPECT_EQ(survey.epoch, 1U);
  EXPECT_EQ(survey.loop_closing.last_prompt_s, 3.5);
  EXPECT_EQ(survey.loop_closing.prompts, 7U);
  EXPECT_EQ(survey.loop_closing.bytes_moved, 5U);
  EXPECT_EQ(survey.settings.survey, 77U);
  EXPECT_EQ(survey.settings.text, "all of them");
}

// ---- what is refused -----------------------------------------------------------------------

TEST_F(Journal, IsNotResumedUnderOtherParametersWhichAreNamedWithBothValues) {
  FilterParams params = journalledParams();
  {
    ParticleFilter filter(params);
    const auto journal = journalOf(&filter, path());
    filter.observe(nullptr);
  }
  EXPECT_EQ(problemOf(path(), params), "");
  params.particles = 7;
  params.motion.surge_std_m = 0.25;
  const std::string problem = problemOf(path(), params);
  EXPECT_NE(problem.find("particles is 7, expected 6"), std::string::npos) << problem;
  EXPECT_NE(problem.find("motion/surge_std_m is 0.25, expected 0.3"), std::string::npos) << problem;
  EXPECT_EQ(problem.find("seed"), std::string::npos) << problem;
}

TEST_F(Journal, IsNotResumedIfTheFileIsNone) {
  EXPECT_NE(problemOf(path("none"), journalledParams()).find("cannot be read"), std::string::npos);
  write(path("short"), "RBPF");
  EXPECT_NE(problemOf(path("short"), journalledParams()).find("is no journal: it has 4 bytes"),
            std::string::npos);
  write(path("foreign"), "#ROSBAG V2.0\nand so on");
  EXPECT_NE(problemOf(path("foreign"), journalledParams()).find("is no journal: it does not begin"),
            std::string::npos);
  write(path("later"), std::string("RBPFJRNL\x07\0\0\0 and so on", 22));
  const std::string problem = problemOf(path("later"), journalledParams());
  EXPECT_NE(problem.find("format version 7, expected 4"), std::string::npos) << problem;
  write(path("empty"), std::string("RBPFJRNL\x04\0\0\0", 12));
  EXPECT_NE(problemOf(path("empty"), journalledParams()).find("no whole record"),
            std::string::npos);
}

TEST_F(Journal, IsNotResumedIfARecordIsNoneOfThisFilters) {
  {
    ParticleFilter filter(journalledParams());
    const auto journal = journalOf(&filter, path());
    filter.observe(nullptr);
    journal->onChange(Resampled{{0, 1}});
  }
  const std::string problem = problemOf(path(), journalledParams());
  EXPECT_NE(problem.find("at its record 1"), std::string::npos) << problem;
}

TEST_F(Journal, IsNotLostToAnotherSurveyUnlessThatIsWished) {
  write(path(), "a survey");
  try {
    JournalWriter(path(), Existing::kRefuse, nullptr);
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find("is there already, of 8 bytes"), std::string::npos)
        << error.what();
  }
  EXPECT_EQ(bytesOf(path()), "a survey");
  JournalWriter(path(), Existing::kOverwrite, nullptr);
  EXPECT_EQ(bytesOf(path()).substr(0, 8), "RBPFJRNL");
}

TEST_F(Journal, IsWrittenByOneProcessAtATime) {
  const JournalWriter first(path(), Existing::kRefuse, nullptr);
  EXPECT_THROW(JournalWriter(path(), Existing::kOverwrite, nullptr), std::runtime_error);
  EXPECT_THROW(JournalWriter(path(), 12, nullptr), std::runtime_error);
}

TEST(FilterSettings, AreReadBackAsTheyWere) {
  FilterParams params = journalledParams();
  params.odometry.velocity = Velocity::kTwist;
  params.start_pose = {0.1, -1e7, 1.0 / 3.0};
  params.common_random_numbers = true;
  const FilterSettings settings = settingsOf(params);
  EXPECT_EQ(settingsOf(paramsOf(settings)).text, settings.text);
  EXPECT_EQ(paramsOf(settings).start_pose->yaw_rad, 1.0 / 3.0);
  EXPECT_EQ(paramsOf(settingsOf(FilterParams{})).start_pose, std::nullopt);
  EXPECT_THROW(paramsOf({"particles 5\n"}), std::runtime_error);
  const std::string rest = settings.text.substr(settings.text.find('\n'));
  for (const char* wrong : {"0", "-1", "100001", "99999999999999999999"}) {
    EXPECT_THROW(paramsOf({std::string("particles ") + wrong + rest}), std::runtime_error) << wrong;
  }
}

// ---- changes as bytes ----------------------------------------------------------------------

TEST(ChangeBytes, OfAnyOtherLengthOrTypeAreRefused) {
  const std::vector<std::uint8_t> bytes = toBytes(pingAt(1.0, 3));
  const std::size_t type = Change(Ping{}).index();
  EXPECT_EQ(std::get<Ping>(toChange(type, bytes)).beams_m, pingAt(1.0, 3).beams_m);
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    EXPECT_THROW(toChange(type, {bytes.begin(), bytes.begin() + static_cast<long>(size)}),
                 std::invalid_argument);
  }
  std::vector<std::uint8_t> longer = bytes;
  longer.push_back(0);
  EXPECT_THROW(toChange(type, longer), std::invalid_argument);
  EXPECT_THROW(toChange(std::variant_size_v<Change>, bytes), std::invalid_argument);
}

}  // namespace
}  // namespace rbpf_core
