// Algorithm 2: when the particles are resampled, and the two phases in which their maps follow.
#include <gtest/gtest.h>

#include <atomic>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "fake_maps.hpp"

namespace rbpf_core {
namespace {

using Ancestors = std::vector<std::uint32_t>;
using Calls = std::vector<std::string>;

const auto kFail = [] { throw std::runtime_error("node 1 has died"); };

class LoopClosingResampling : public LoopClosingTest {
 protected:
  // One map explains the ping, the others do not: N_eff is 1 after the next prompt.
  void favourParticle(Eigen::Index favourite) {
    maps.error_m.setConstant(2.0);
    maps.error_m(favourite) = 0.0;
  }

  std::vector<Pose2> particles() const { return filter.snapshot().particles(); }

  LoopClosing resampling{filter, maps, productRule(0.5)};
};

// ---- the rule ----------------------------------------------------------------------------------

TEST(OnEffectiveSizeDrop, ResamplesBelowItsShareOfTheParticlesAndNotAtIt) {
  const Eigen::Array4d half(0.5, 0.5, 0.0, 0.0);  // N_eff is 2 exactly
  EXPECT_FALSE(OnEffectiveSizeDrop{}(half));
  EXPECT_TRUE(OnEffectiveSizeDrop{}(Eigen::Array4d(0.5 + 1e-6, 0.5 - 1e-6, 0.0, 0.0)));
  EXPECT_TRUE(OnEffectiveSizeDrop{0.6}(half));
  EXPECT_FALSE(OnEffectiveSizeDrop{0.4}(half));
  EXPECT_FALSE(OnEffectiveSizeDrop{0.0}(Eigen::Array4d(1.0, 0.0, 0.0, 0.0)));  // never
}

TEST_F(LoopClosingResampling, LeavesTheParticlesAloneWhileEnoughOfThemCount) {
  maps.error_m << 0.0, 0.01, 0.02, 0.03;
  EXPECT_EQ(resampling.step().outcome, StepOutcome::kPrompted);
  EXPECT_EQ(maps.calls, Calls{"predict 0"});
  EXPECT_FALSE(weightsAreUniform());
  EXPECT_EQ(resampling.epoch(), 0U);
}

TEST_F(LoopClosingResampling, AsksWhateverPolicyItIsGiven) {
  std::vector<Eigen::ArrayXd> asked;
  LoopClosingParams params = productRule(0.0);
  params.resample_when = [&](const Eigen::ArrayXd& w) {
    asked.push_back(w);
    return asked.size() == 2;
  };
  LoopClosing every_second(filter, maps, params);
  maps.error_m << 0.0, 0.01, 0.02, 0.03;
  EXPECT_EQ(every_second.step().outcome, StepOutcome::kPrompted);
  EXPECT_TRUE(asked[0].isApprox(weights()));
  sailOn();
  EXPECT_EQ(every_second.step().outcome, StepOutcome::kResampled);
  EXPECT_EQ(every_second.epoch(), 1U);
}

// ---- a resampling that is committed ------------------------------------------------------------

TEST_F(LoopClosingResampling, ReplacesParticlesHistoriesAndMapsByTheSameAncestors) {
  favourParticle(2);
  const std::vector<Pose2> before = particles();
  const StepResult step = resampling.step();
  EXPECT_EQ(step.outcome, StepOutcome::kResampled);
  EXPECT_EQ(step.problem, "");
  EXPECT_EQ(maps.calls, (Calls{"predict 0", "prepare 1", "commit 1"}));
  EXPECT_EQ(maps.ancestors, (Ancestors{2, 2, 2, 2}));
  EXPECT_EQ(particles(), std::vector<Pose2>(4, before[2]));
  EXPECT_EQ(filter.snapshot().latestPing()->poses, std::vector<Pose2>(4, maps.pings[0].poses[2]));
  EXPECT_TRUE(weightsAreUniform());
  EXPECT_EQ(resampling.epoch(), 1U);
  EXPECT_EQ(resampling.statistics().prompts, 1U);
  EXPECT_EQ(resampling.statistics().message, "closing loops");
}

TEST_F(LoopClosingResampling, PlansBySystematicResamplingNumberedForFewMoves) {
  maps.error_m << 1.0, 0.02, 1.0, 0.0;  // two offspring each
  resampling.step();
  EXPECT_EQ(maps.ancestors, (Ancestors{1, 1, 3, 3}));  // each within its own node, of two maps
}

TEST_F(LoopClosingResampling, PredictsUnderTheNewEpochFromThenOn) {
  favourParticle(1);
  resampling.step();
  maps.error_m.setZero();
  sailOn();
  EXPECT_EQ(resampling.step().outcome, StepOutcome::kPrompted);
  EXPECT_EQ(maps.calls.back(), "predict 1");
}

TEST_F(LoopClosingResampling, AddsUpWhatWasMoved) {
  for (int k = 0; k < 3; ++k) {
    favourParticle(k);
    EXPECT_EQ(resampling.step().outcome, StepOutcome::kResampled);
    sailOn();
  }
  const LoopClosingStatistics statistics = resampling.statistics();
  EXPECT_EQ(resampling.epoch(), 3U);
  EXPECT_EQ(statistics.moved.maps, 6U);
  EXPECT_EQ(statistics.moved.bytes, 3000U);
  EXPECT_GE(statistics.resampling_s, 0.0);
  EXPECT_EQ(statistics.resamplings_failed, 0U);
}

// Preparing takes seconds; the pings of that time belong to the ancestors' histories as well.
TEST_F(LoopClosingResampling, TakesPingsInWhileTheMapsPrepare) {
  favourParticle(3);
  std::vector<Pose2> before;
  maps.on_prepare = [&] {
    std::thread([this] { sailOn(); }).join();  // would never end if the step held a lock
    before = filter.snapshot().latestPing()->poses;
  };
  EXPECT_EQ(resampling.step().outcome, StepOutcome::kResampled);
  EXPECT_EQ(filter.snapshot().latestPing()->poses, std::vector<Pose2>(4, before[3]));
}

TEST_F(LoopClosingResampling, IsCommittedEvenIfNotEverybodyCanBeTold) {
  favourParticle(2);
  const std::vector<Pose2> before = particles();
  maps.on_commit = kFail;
  const StepResult step = resampling.step();
  EXPECT_EQ(step.outcome, StepOutcome::kResampled);
  EXPECT_EQ(step.problem, "node 1 has died");
  EXPECT_EQ(resampling.epoch(), 1U);
  EXPECT_EQ(particles(), std::vector<Pose2>(4, before[2]));
  EXPECT_EQ(resampling.statistics().resamplings_failed, 0U);
  // no prompt before it has asked, and reports under the new epoch
  maps.epoch_of = {1, 0};
  sailOn();
  EXPECT_EQ(resampling.step().outcome, StepOutcome::kNotReady);
  EXPECT_EQ(resampling.statistics().message, "waiting for map nodes: 1 of 2 have reported");
}

// ---- a resampling that is rolled back ----------------------------------------------------------

TEST_F(LoopClosingResampling, IsRolledBackIfANodeCannotPrepare) {
  favourParticle(2);
  const std::vector<Pose2> before = particles();
  maps.on_prepare = kFail;
  const StepResult step = resampling.step();
  EXPECT_EQ(step.outcome, StepOutcome::kRolledBack);
  EXPECT_EQ(step.problem, "resampling rolled back: node 1 has died");
  EXPECT_EQ(maps.calls, (Calls{"predict 0", "prepare 1", "abort 1"}));
  EXPECT_EQ(particles(), before);
  EXPECT_NEAR(weights()(2), 1.0, 1e-6);  // the prompt's weights are kept
  EXPECT_EQ(resampling.epoch(), 0U);
  EXPECT_FALSE(resampling.progress().resampling);
  EXPECT_EQ(resampling.statistics().resamplings_failed, 1U);
  EXPECT_EQ(resampling.statistics().message, step.problem);
  EXPECT_EQ(resampling.statistics().moved.maps, 0U);
}

TEST_F(LoopClosingResampling, IsTriedAgainAfterTheNextPromptWhateverThatSays) {
  LoopClosing robust(filter, maps, {});
  filter.setLogWeights(Eigen::Array4d(0.97, 0.01, 0.01, 0.01).log());
  maps.on_prepare = kFail;
  EXPECT_EQ(robust.step().outcome, StepOutcome::kRolledBack);
  maps.on_prepare = nullptr;
  maps.error_m.setConstant(10.0);  // vetoed
  sailOn();
  EXPECT_EQ(robust.step().outcome, StepOutcome::kResampled);
  EXPECT_EQ(robust.statistics().prompts_vetoed, 1U);
  EXPECT_EQ(robust.epoch(), 1U);
  EXPECT_EQ(maps.calls,
            (Calls{"predict 0", "prepare 1", "abort 1", "predict 0", "prepare 1", "commit 1"}));
}

TEST_F(LoopClosingResampling, IsNotTriedIfThePredictionFails) {
  filter.setLogWeights(Eigen::Array4d(0.97, 0.01, 0.01, 0.01).log());
  maps.on_predict = [](PingPrediction*) { kFail(); };
  EXPECT_EQ(resampling.step().outcome, StepOutcome::kFailed);
  EXPECT_EQ(maps.calls, Calls{"predict 0"});
}

TEST_F(LoopClosingResampling, IsRolledBackEvenIfNotEverybodyCanBeTold) {
  favourParticle(0);
  maps.on_prepare = maps.on_abort = kFail;
  EXPECT_EQ(resampling.step().outcome, StepOutcome::kRolledBack);
  EXPECT_FALSE(resampling.progress().resampling);
  EXPECT_EQ(resampling.statistics().resamplings_failed, 1U);
}

TEST_F(LoopClosingResampling, IsRolledBackIfTheFilterRefusesTheAncestors) {
  const std::vector<Pose2> before = particles();
  for (const Ancestors& malformed : {Ancestors{0, 1}, Ancestors{0, 1, 2, 4}}) {
    EXPECT_EQ(resampling.resample(malformed).outcome, StepOutcome::kRolledBack);
    EXPECT_EQ(maps.calls.back(), "abort 1");
  }
  EXPECT_EQ(particles(), before);
  EXPECT_EQ(resampling.epoch(), 0U);
}

// ---- what map nodes hear that ask --------------------------------------------------------------

// A node that asks is told, in each phase, what it may rely on.
TEST_F(LoopClosingResampling, SaysWhetherItsOutcomeIsDecided) {
  favourParticle(1);
  const auto expectProgress = [&](std::uint32_t epoch, bool in_progress) {
    EXPECT_EQ(resampling.progress().epoch, epoch);
    EXPECT_EQ(resampling.progress().resampling, in_progress);
  };
  expectProgress(0, false);
  maps.on_prepare = [&] {
    expectProgress(0, true);
    kFail();
  };
  maps.on_abort = [&] { expectProgress(0, false); };
  EXPECT_EQ(resampling.step().outcome, StepOutcome::kRolledBack);
  maps.on_prepare = [&] { expectProgress(0, true); };
  maps.on_commit = [&] {
    expectProgress(1, false);
    EXPECT_TRUE(weightsAreUniform());  // the particles have been resampled before anybody hears
  };
  sailOn();
  EXPECT_EQ(resampling.step().outcome, StepOutcome::kResampled);
}

// Meant for ThreadSanitizer too. A node that has prepared for an epoch and hears "not resampling"
// under the one before throws its new maps away: it must never hear that of a resampling that ends
// well.
TEST_F(LoopClosingResampling, NeverSeemsRolledBackWhenItEndsWell) {
  std::atomic<std::uint32_t> prepared{0};
  std::atomic<bool> stop{false};
  std::atomic<int> seemed_rolled_back{0};
  std::atomic<int> asked{0};
  maps.on_prepare = [&] { prepared = resampling.epoch() + 1; };
  std::thread node([&] {
    for (; !stop; ++asked) {
      const std::uint32_t prepared_for = prepared;
      const LoopClosing::Progress progress = resampling.progress();
      if (!progress.resampling && progress.epoch < prepared_for) ++seemed_rolled_back;
    }
  });
  for (int k = 0; k < 2000 || asked < 10000; ++k) resampling.resample({0, 1, 2, 3});
  stop = true;
  node.join();
  EXPECT_EQ(seemed_rolled_back, 0);
}

}  // namespace
}  // namespace rbpf_core
