// The rules of /diagnostics, each at its limits.
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "rbpf_node/health_rules.hpp"

namespace rbpf_node {
namespace {

constexpr Level kOk = Level::kOk;
constexpr Level kWarn = Level::kWarn;
constexpr Level kError = Level::kError;

void expectVerdict(const Verdict& verdict, Level level, const std::string& part) {
  EXPECT_EQ(verdict.level, level) << verdict.text;
  EXPECT_NE(verdict.text.find(part), std::string::npos) << verdict.text;
}

// ---- verdicts ------------------------------------------------------------------------------

TEST(Verdict, SaysTheWorstFirstAndNothingFineBesideIt) {
  Verdict verdict{kOk, "odometry: coming in"};
  verdict.add(kOk, "pings: coming in");
  EXPECT_EQ(verdict.text, "odometry: coming in; pings: coming in");
  verdict.add(kWarn, "slow");
  verdict.add(kError, "dead");
  verdict.add(kWarn, "late");
  verdict.add(kOk, "fine");
  EXPECT_EQ(verdict.level, kError);
  EXPECT_EQ(verdict.text, "dead; slow; late");
}

TEST(Verdict, NumbersAreThoseOfDiagnosticStatus) {
  EXPECT_EQ(static_cast<int>(kOk), 0);
  EXPECT_EQ(static_cast<int>(kWarn), 1);
  EXPECT_EQ(static_cast<int>(kError), 2);
}

// ---- odometry, pings -----------------------------------------------------------------------

// Of pings: a warning after 10 s without any, an error after 60 s.
class Pings : public ::testing::Test {
 protected:
  Verdict at(double now_s) { return health_.judge(facts_, true, now_s); }

  StreamHealth health_{"pings", "odometry", 10.0, 60.0};
  StreamFacts facts_;
};

TEST_F(Pings, AreAwaitedAtFirst) {
  expectVerdict(at(1000.0), kWarn, "no pings yet");
  expectVerdict(at(2000.0), kWarn, "no pings yet");
}

TEST_F(Pings, AreStaleByTheTimeSinceTheLast) {
  facts_.taken = 1;
  expectVerdict(at(100.0), kOk, "pings: coming in");
  expectVerdict(at(109.9), kOk, "pings: coming in");
  expectVerdict(at(111.0), kWarn, "no pings for 11 s");
  expectVerdict(at(161.0), kError, "no pings for 61 s");
  facts_.taken = 2;
  expectVerdict(at(162.0), kOk, "pings: coming in");
}

TEST_F(Pings, MayBeSilentWhenNobodyAwaitsThem) {
  facts_.taken = 1;
  health_.judge(facts_, false, 0.0);
  expectVerdict(health_.judge(facts_, false, 1e6), kOk, "pings: coming in");
}

TEST_F(Pings, ThatWaitAreSpokenOfOnceNoneIsTakenIn) {
  facts_.taken = 5;
  facts_.waiting = 2;
  expectVerdict(at(0.0), kOk, "coming in");
  expectVerdict(at(6.0), kWarn, "pings: 2 messages wait for odometry");
  facts_.waiting = 1;
  expectVerdict(at(61.0), kError, "no pings for 61 s; pings: 1 message waits for odometry");
}

TEST_F(Pings, RefusedNowAndThenAreAWarningForAMinute) {
  facts_.taken = 100;
  facts_.refused = {{"pings/malformed", 1}};
  at(0.0);
  facts_.taken = 200;
  facts_.refused["pings/no_beams"] = 1;
  expectVerdict(at(1.0), kWarn, "some refused within the last minute, the last for pings/no_beams");
  facts_.taken = 300;
  expectVerdict(at(61.5), kOk, "coming in");
}

TEST_F(Pings, AllRefusedIsAnError) {
  facts_.refused = {{"pings/clock_ahead", 1}};
  expectVerdict(at(0.0), kError, "every message is refused, the last for pings/clock_ahead");
  facts_.taken = 1;
  at(1.0);
  for (int s = 2; s < 10; ++s) {
    ++facts_.refused["pings/clock_ahead"];
    EXPECT_EQ(at(s).level, s <= 6 ? kWarn : kError) << s;
  }
}

TEST_F(Pings, StampedAfterTheirReceiptOrLongBeforeItAreAWarning) {
  facts_.taken = 1;
  for (const auto& [age_s, level, part] : {std::tuple{-0.4, kOk, "coming in"},
                                           {-3.25, kWarn, "stamped 3.2 s after the receipt"},
                                           {4.9, kOk, "coming in"},
                                           {15.0, kWarn, "received 15.0 s after the stamp"},
                                           {std::nan(""), kOk, "coming in"}}) {
    facts_.age_s = age_s;
    expectVerdict(at(0.0), level, part);
  }
}

// ---- maps ----------------------------------------------------------------------------------

MapsFacts healthyMaps() {
  MapsFacts facts;
  facts.nodes = facts.nodes_following = 3;
  facts.silent_s = {{0, 0.5}, {1, 0.1}, {2, 4.9}};
  facts.particles = facts.maps_ready = 40;
  facts.running_s = 1000.0;
  return facts;
}

TEST(Maps, AreFineWhileAllNodesReport) {
  expectVerdict(judgeMaps(healthyMaps()), kOk, "40 of 40 maps are ready");
}

TEST(Maps, OfAStoppedNodeAreNotReadyWhateverItHasSaidLast) {
  MapsFacts facts = healthyMaps();
  facts.silent_s[1] = 6.0;
  expectVerdict(judgeMaps(facts), kWarn, "svgp_node_1 not heard of for 6 s");
  facts.silent_s[1] = 11.0;
  const Verdict verdict = judgeMaps(facts);
  expectVerdict(verdict, kError, "svgp_node_1 not heard of for 11 s");
  EXPECT_EQ(verdict.text.find("ready"), std::string::npos);
  facts.is_live = false;  // they report in their turns
  expectVerdict(judgeMaps(facts), kOk, "40 of 40 maps are ready");
}

TEST(Maps, OfNodesThatNeverCameAreAnErrorOnceTheyShouldHave) {
  MapsFacts facts = healthyMaps();
  facts.nodes = 8;
  facts.running_s = 10.0;
  expectVerdict(judgeMaps(facts), kWarn,
                "svgp_node_3, svgp_node_4, svgp_node_5 and 2 more not heard of yet");
  facts.running_s = 31.0;
  EXPECT_EQ(judgeMaps(facts).level, kError);
}

TEST(Maps, OfNodesThatHaveNotFollowedAreAWarning) {
  MapsFacts facts = healthyMaps();
  facts.nodes_following = 2;
  facts.resampled_s = 5.1;
  expectVerdict(judgeMaps(facts), kWarn, "1 of 3 map nodes have not followed");
  facts.resampled_s = 4.9;
  EXPECT_EQ(judgeMaps(facts).level, kOk);
}

// ---- prompts -------------------------------------------------------------------------------

TEST(Prompts, ThatFailInARowAreAnErrorFromTheThirdOn) {
  PromptHealth health;
  PromptFacts facts;
  facts.failed = 7;  // of another life of the core
  facts.message = "svgp_node_1/predict: timed out";
  expectVerdict(health.judge(facts), kOk, facts.message);
  facts.failed = 8;
  expectVerdict(health.judge(facts), kWarn, "1 prompt failed since the last that did not: svgp_");
  facts.failed = 10;
  expectVerdict(health.judge(facts), kError, "3 prompts failed");
  facts.prompts = 1;
  EXPECT_EQ(health.judge(facts).level, kOk);
  facts.failed = 11;
  EXPECT_EQ(health.judge(facts).level, kWarn);
}

TEST(Prompts, RolledBackOrVetoedInARowAreSpokenOf) {
  PromptHealth health;
  PromptFacts facts;
  health.judge(facts);
  facts.vetoed = 9;
  EXPECT_EQ(health.judge(facts).level, kOk);
  facts.vetoed = 10;
  expectVerdict(health.judge(facts), kWarn, "the last 10 prompts vetoed");
  facts.rolled_back = 1;
  expectVerdict(health.judge(facts), kWarn, "1 resampling rolled back");
  facts.rolled_back = 3;
  expectVerdict(health.judge(facts), kError, "3 resamplings rolled back");
  facts.resamplings = facts.prompts = 1;
  EXPECT_EQ(health.judge(facts).level, kOk);
}

// ---- machine, journal ----------------------------------------------------------------------

TEST(Machine, IsShortOfDisk) {
  MachineFacts facts{"/runs", 501.0, std::nullopt, std::nullopt};
  expectVerdict(judgeMachine(facts), kOk, "suffice");
  facts.disk_free_mb = 499.0;
  expectVerdict(judgeMachine(facts), kWarn, "499 MB are free on the disk of /runs");
  facts.disk_free_mb = 99.0;
  EXPECT_EQ(judgeMachine(facts).level, kError);
  facts.disk_free_mb = std::nullopt;
  expectVerdict(judgeMachine(facts), kError, "the disk of /runs does not say");
  facts.folder = "";
  EXPECT_EQ(judgeMachine(facts).level, kOk);
}

TEST(Machine, IsShortOfMemory) {
  MachineFacts facts{"", std::nullopt, 410.0, 4000.0};
  EXPECT_EQ(judgeMachine(facts).level, kOk);
  facts.memory_available_mb = 390.0;
  expectVerdict(judgeMachine(facts), kWarn, "390 of 4000 MB of memory are available");
  facts.memory_available_mb = 110.0;
  EXPECT_EQ(judgeMachine(facts).level, kError);
}

TEST(Journal, HasEndedOrWaitsForASlowDisk) {
  expectVerdict(judgeJournal({}), kOk, "the survey can be resumed");
  expectVerdict(judgeJournal({"", std::uint64_t{20} << 20}), kWarn, "21 MB of the journal wait");
  expectVerdict(judgeJournal({"No space left on device", 0}), kError,
                "the journal has ended: No space left on device");
}

}  // namespace
}  // namespace rbpf_node
