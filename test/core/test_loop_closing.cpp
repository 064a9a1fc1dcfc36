// Algorithm 2: when there is a prompt, and what becomes of the weights.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "fake_maps.hpp"

namespace rbpf_core {
namespace {

using Calls = std::vector<std::string>;

// ---- prompts -----------------------------------------------------------------------------------

TEST_F(LoopClosingTest, HasNothingToDoBeforeTheFirstPing) {
  ParticleFilter empty(noisyParams(kParticles));
  LoopClosing waiting(empty, maps, productRule(0.5));
  EXPECT_FALSE(waiting.isDue());
  EXPECT_EQ(waiting.step().outcome, StepOutcome::kNotDue);
  empty.addOdometry(turning(0.0));
  EXPECT_EQ(waiting.step().outcome, StepOutcome::kNotDue);
  EXPECT_TRUE(maps.calls.empty());
  EXPECT_EQ(waiting.statistics().message, "waiting for pings");
}

TEST_F(LoopClosingTest, PromptsAtItsRateInTheSurveysOwnTime) {
  LoopClosingParams params = productRule(0.0);
  params.rate_hz = 0.5;
  LoopClosing often(filter, maps, params);
  for (int k = 30; k < 130; ++k) {
    sail(filter, turning, k, k + 1);
    for (int again = 0; again < 3; ++again) often.step();
  }
  // a ping every 1.4 s, looked for once a second: every 2 s at most, every 4.4 s at least
  for (std::size_t i = 1; i < maps.pings.size(); ++i) {
    const double period_s = maps.pings[i].stamp_s - maps.pings[i - 1].stamp_s;
    EXPECT_GE(period_s, 2.0);
    EXPECT_LE(period_s, 4.4);
  }
  EXPECT_GE(maps.pings.size(), 22U);
}

TEST_F(LoopClosingTest, DoesNotCountAGapInTheOdometryAsTimeSinceTheLastPrompt) {
  LoopClosingParams params = productRule(0.0);
  params.rate_hz = 0.1;
  LoopClosing rarely(filter, maps, params);
  EXPECT_EQ(rarely.step().outcome, StepOutcome::kPrompted);
  sail(filter, turning, 3601, 3605);
  EXPECT_FALSE(rarely.isDue());  // 2 s of the gap and 4 s since
  sail(filter, turning, 3605, 3613);
  EXPECT_TRUE(rarely.isDue());
}

TEST_F(LoopClosingTest, NeverPromptsAtARateOfZero) {
  LoopClosingParams params;
  params.rate_hz = 0.0;
  LoopClosing never(filter, maps, params);
  EXPECT_FALSE(never.isDue());
  EXPECT_EQ(never.step().outcome, StepOutcome::kNotDue);
  EXPECT_TRUE(maps.calls.empty());
}

TEST_F(LoopClosingTest, AsksTheMapsForTheLatestPingWhereEachParticleSawIt) {
  EXPECT_EQ(closing.step().outcome, StepOutcome::kPrompted);
  EXPECT_EQ(maps.calls, Calls{"predict 0"});
  const PlacedPing latest = filter.snapshot().latestPing().value();
  EXPECT_EQ(maps.pings[0].stamp_s, latest.stamp_s);
  EXPECT_EQ(maps.pings[0].levelled_m, latest.levelled_m);
  EXPECT_EQ(maps.pings[0].poses, latest.poses);
}

TEST_F(LoopClosingTest, WaitsForEveryNodeToReport) {
  maps.epoch_of = {0, 7};  // the second is elsewhere
  const StepResult step = closing.step();
  EXPECT_EQ(step.outcome, StepOutcome::kNotReady);
  EXPECT_EQ(step.problem, "");  // nothing to complain of: nodes take their time to start
  EXPECT_TRUE(maps.calls.empty());
  EXPECT_EQ(closing.statistics().prompts_skipped, 1U);
  EXPECT_EQ(closing.statistics().message, "waiting for map nodes: 1 of 2 have reported");
  EXPECT_EQ(closing.step().outcome, StepOutcome::kNotDue);  // not before the next prompt is due
}

TEST_F(LoopClosingTest, WaitsForEveryMapToBeReady) {
  maps.ready = 3;
  EXPECT_EQ(closing.step().outcome, StepOutcome::kNotReady);
  EXPECT_TRUE(maps.calls.empty());
  EXPECT_EQ(closing.statistics().prompts_skipped, 1U);
  EXPECT_EQ(closing.statistics().message, "maps are training: 3 of 4 are ready");
  maps.ready = 4;
  sailOn();
  EXPECT_EQ(closing.step().outcome, StepOutcome::kPrompted);
}

TEST_F(LoopClosingTest, WaitsForEveryNodesMapsToFollowACorrectedPast) {
  filter.correctPast({});
  filter.correctPast({});
  maps.past_of = {2, 1};
  EXPECT_EQ(closing.step().outcome, StepOutcome::kNotReady);
  EXPECT_TRUE(maps.calls.empty());
  EXPECT_EQ(closing.statistics().message, "maps follow the corrected past: 1 of 2 nodes have");
  maps.past_of = {2, 2};
  sailOn();
  EXPECT_EQ(closing.step().outcome, StepOutcome::kPrompted);
}

// ---- prompts that are asked for ----------------------------------------------------------------

TEST_F(LoopClosingTest, WeighsTheLatestPingWhenAskedWhateverTheRate) {
  maps.error_m << 0.0, 0.1, 0.2, 0.3;
  LoopClosingParams params = productRule(0.0);
  params.rate_hz = 0.0;
  LoopClosing never(filter, maps, params);
  const AskedPrompt asked = never.promptNow();
  EXPECT_EQ(asked.outcome, StepOutcome::kPrompted);
  EXPECT_TRUE(asked.has_weighed);
  EXPECT_EQ(asked.why, "");
  EXPECT_NEAR(asked.n_eff_before, 4.0, 1e-9);
  EXPECT_EQ(asked.n_eff_weighed, effectiveParticles(weights()));
  EXPECT_LT(asked.n_eff_weighed, 3.9);
}

TEST_F(LoopClosingTest, WeighsNoPingTwiceBecauseItIsAskedTo) {
  maps.error_m << 0.0, 0.1, 0.2, 0.3;
  closing.step();
  const Eigen::ArrayXd once = weights();
  const AskedPrompt asked = closing.promptNow();
  EXPECT_EQ(asked.outcome, StepOutcome::kNotDue);
  EXPECT_FALSE(asked.has_weighed);
  EXPECT_EQ(asked.why, "the latest ping has been weighed already");
  EXPECT_TRUE(weights().isApprox(once));
  sailOn();
  EXPECT_TRUE(closing.promptNow().has_weighed);
  EXPECT_FALSE(closing.isDue());  // the rate counts from there
}

TEST_F(LoopClosingTest, SaysWhyAPromptThatIsAskedForCannotBeMade) {
  ParticleFilter empty(noisyParams(kParticles));
  LoopClosing waiting(empty, maps, productRule(0.5));
  EXPECT_EQ(waiting.promptNow().why, "no ping has been taken in");
  maps.ready = 3;
  const AskedPrompt not_ready = closing.promptNow();
  EXPECT_EQ(not_ready.outcome, StepOutcome::kNotReady);
  EXPECT_EQ(not_ready.why, "maps are training: 3 of 4 are ready");
  maps.ready = 4;
  maps.on_predict = [](PingPrediction*) { throw std::runtime_error("node 1 is gone"); };
  const AskedPrompt failed = closing.promptNow();
  EXPECT_EQ(failed.outcome, StepOutcome::kFailed);
  EXPECT_FALSE(failed.has_weighed);
  EXPECT_EQ(failed.why, "node 1 is gone");
  EXPECT_TRUE(weightsAreUniform());
}

TEST_F(LoopClosingTest, ResamplesAfterAPromptThatWasAskedFor) {
  maps.error_m << 0.0, 0.5, 0.5, 0.5;
  LoopClosing resampling(filter, maps, productRule(0.5));
  const AskedPrompt asked = resampling.promptNow();
  EXPECT_EQ(asked.outcome, StepOutcome::kResampled);
  EXPECT_LT(asked.n_eff_weighed, 2.0);  // of the weights that led to it
  EXPECT_TRUE(weightsAreUniform());
}

// ---- weights -----------------------------------------------------------------------------------

TEST_F(LoopClosingTest, CountsTheMapsElboAsBeamsOnlyWhereItIsToldTo) {
  maps.elbo = Eigen::ArrayXd::Zero(4);
  maps.elbo << -0.5, -0.7, -0.9, -0.6;
  closing.step();
  EXPECT_TRUE(weights().isApprox(Eigen::ArrayXd::Constant(4, 0.25)));  // as the product rule has it

  LoopClosingParams params = productRule(0.0);
  params.weighting.elbo_beams = 3.0;
  LoopClosing by_elbo(filter, maps, params);
  sailOn();
  EXPECT_EQ(by_elbo.step().outcome, StepOutcome::kPrompted);
  const Eigen::ArrayXd expected = (3.0 * maps.elbo).exp();
  EXPECT_TRUE(weights().isApprox(expected / expected.sum()));

  maps.elbo(2) = std::numeric_limits<double>::quiet_NaN();
  sailOn();
  const StepResult step = by_elbo.step();
  EXPECT_EQ(step.outcome, StepOutcome::kFailed);
  EXPECT_NE(step.problem.find("ELBO is not finite"), std::string::npos) << step.problem;
  EXPECT_TRUE(weights().isApprox(expected / expected.sum()));
}

TEST_F(LoopClosingTest, WeighsTheParticlesByWhatTheirMapsPredict) {
  maps.error_m << 0.0, 0.1, 0.2, 0.3;
  EXPECT_EQ(closing.step().outcome, StepOutcome::kPrompted);
  // n beams, each exp(-error^2 / 2 (variance + Q))
  const auto n = static_cast<double>(maps.pings[0].levelled_m.cols());
  const Eigen::ArrayXd expected = (-0.5 * n * maps.error_m.square() / (0.04 + 0.09)).exp();
  EXPECT_TRUE(weights().isApprox(expected / expected.sum(), 1e-5));  // depths are float32
  const LoopClosingStatistics statistics = closing.statistics();
  EXPECT_EQ(statistics.prompts, 1U);
  EXPECT_EQ(statistics.tempering, 1.0);
  EXPECT_EQ(statistics.overlap, 1.0);
  EXPECT_GE(statistics.prompt_s, 0.0);
  EXPECT_EQ(statistics.message, "closing loops");
}

TEST_F(LoopClosingTest, CarriesWeightsOverFromPromptToPrompt) {
  maps.error_m << 0.0, 0.1, 0.2, 0.1;
  closing.step();
  const Eigen::ArrayXd first = weights();
  sailOn();
  closing.step();
  const auto n = [&](std::size_t ping) {
    return static_cast<double>(maps.pings[ping].levelled_m.cols());
  };
  const double exponent = (n(0) + n(1)) / n(0);
  const Eigen::ArrayXd expected = (exponent * (first / first(0)).log()).exp();
  EXPECT_TRUE(weights().isApprox(expected / expected.sum(), 1e-5));
  EXPECT_EQ(closing.statistics().prompts, 2U);
}

TEST_F(LoopClosingTest, KeepsTheWeightsOverSeabedThatIsNotMapped) {
  LoopClosing robust(filter, maps, {});
  maps.error_m << 0.0, 0.1, 0.2, 0.3;
  maps.on_predict = [](PingPrediction* prediction) { prediction->variance_m2.setConstant(3.9); };
  const StepResult step = robust.step();
  EXPECT_EQ(step.outcome, StepOutcome::kPrompted);
  EXPECT_EQ(step.problem, "");
  EXPECT_TRUE(weightsAreUniform());
  EXPECT_EQ(robust.statistics().prompts, 0U);
  EXPECT_EQ(robust.statistics().prompts_skipped, 1U);
  EXPECT_EQ(robust.statistics().overlap, 0.0);
  EXPECT_EQ(robust.statistics().message, "the vehicle is over seabed that is not mapped yet");
}

TEST_F(LoopClosingTest, KeepsTheWeightsWhenNoMapExplainsThePing) {
  LoopClosing robust(filter, maps, {});
  maps.error_m << 10.0, 11.0, 12.0, 13.0;
  const StepResult step = robust.step();
  EXPECT_EQ(step.outcome, StepOutcome::kPrompted);
  EXPECT_EQ(step.problem, "");
  EXPECT_TRUE(weightsAreUniform());
  EXPECT_EQ(robust.statistics().prompts_vetoed, 1U);
  EXPECT_EQ(robust.statistics().prompts + robust.statistics().prompts_skipped, 0U);
  // 10 m over sqrt(0.04 + 0.09) m
  EXPECT_EQ(robust.statistics().message.find("vetoed: the best map's innovation is 27.735"), 0U);
}

// ---- maps that fail ----------------------------------------------------------------------------

TEST_F(LoopClosingTest, KeepsTheWeightsWhenANodeFailsAndGoesOnWithTheNextPing) {
  maps.error_m << 0.0, 0.5, 0.5, 0.5;
  maps.on_predict = [](PingPrediction*) { throw std::runtime_error("node 1 did not answer"); };
  const StepResult step = closing.step();
  EXPECT_EQ(step.outcome, StepOutcome::kFailed);
  EXPECT_EQ(step.problem, "node 1 did not answer");
  EXPECT_TRUE(weightsAreUniform());
  EXPECT_EQ(closing.statistics().prompts_skipped, 1U);
  EXPECT_EQ(closing.statistics().prompts_failed, 1U);
  EXPECT_EQ(closing.statistics().message, "node 1 did not answer");
  EXPECT_EQ(closing.step().outcome, StepOutcome::kNotDue);
  maps.on_predict = nullptr;
  sailOn();
  EXPECT_EQ(closing.step().outcome, StepOutcome::kPrompted);
  EXPECT_FALSE(weightsAreUniform());
}

TEST_F(LoopClosingTest, RefusesMalformedAnswersAndKeepsTheWeights) {
  using Spoil = std::function<void(PingPrediction*)>;
  const std::map<std::string, Spoil> malformed = {
      {"a particle too few",
       [](PingPrediction* p) {
         p->mean_m = p->mean_m.topRows(3).eval();
         p->variance_m2 = p->variance_m2.topRows(3).eval();
         p->prior_variance_m2 = p->prior_variance_m2.head(3).eval();
       }},
      {"a beam too few", [](PingPrediction* p) { p->mean_m = p->mean_m.leftCols(3).eval(); }},
      {"nothing", [](PingPrediction* p) { *p = PingPrediction(); }},
      {"a mean that is not a number", [](PingPrediction* p) { p->mean_m(2, 1) = std::nan(""); }},
      {"a negative variance", [](PingPrediction* p) { p->variance_m2(0, 0) = -1.0; }},
      {"a prior of zero", [](PingPrediction* p) { p->prior_variance_m2(3) = 0.0; }},
  };
  maps.error_m << 0.0, 0.5, 0.5, 0.5;
  for (const auto& [what, spoil] : malformed) {
    maps.on_predict = spoil;
    const StepResult step = closing.step();
    EXPECT_EQ(step.outcome, StepOutcome::kFailed) << what;
    EXPECT_NE(step.problem, "") << what;
    EXPECT_TRUE(weightsAreUniform()) << what;
    sailOn();
  }
  EXPECT_EQ(closing.statistics().prompts_skipped, malformed.size());
  EXPECT_EQ(closing.epoch(), 0U);
}

// The survey goes on while the maps take their time, and the weights are those of the ping that was
// asked for.
TEST_F(LoopClosingTest, TakesALateAnswerWhileTheSurveyGoesOn) {
  maps.error_m << 0.0, 0.1, 0.2, 0.3;
  std::size_t pings_taken_in = 0;
  maps.on_predict = [&](PingPrediction*) {
    const std::size_t before = filter.snapshot().pings();
    std::thread([this] { sailOn(); }).join();  // would never end if the step held a lock
    pings_taken_in = filter.snapshot().pings() - before;
  };
  EXPECT_EQ(closing.step().outcome, StepOutcome::kPrompted);
  EXPECT_GE(pings_taken_in, 7U);
  EXPECT_GT(weights()(0), weights()(3));
  EXPECT_EQ(closing.statistics().prompts, 1U);
  EXPECT_TRUE(closing.isDue());  // for the pings that have come since
}

}  // namespace
}  // namespace rbpf_core
