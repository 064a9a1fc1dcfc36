// Numbers that computing is not good at: coordinates of a projection, particles that do not differ,
// or that are one alone, likelihoods that are beyond what doubles hold.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numeric>

#include "fake_maps.hpp"

namespace rbpf_core {
namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();

// ---- far from the origin -------------------------------------------------------------------

constexpr double kFar_m = 1e7;

FilterParams paramsAt(double offset_m) {
  FilterParams params = noisyParams(5, 3);
  params.start_pose = Pose2{offset_m, -offset_m, 0.3};
  params.origin = {offset_m, -offset_m};
  params.start_position_std_m = 0.5;
  return params;
}

// The same survey, 1e7 m off; doubles lie 2e-9 m apart there.
TEST(FarFromTheOrigin, TheFilterIsAsFineAsNearIt) {
  ParticleFilter near(paramsAt(0.0));
  ParticleFilter far(paramsAt(kFar_m));
  for (ParticleFilter* filter : {&near, &far}) {
    sail(*filter, turning, 0, 60);
    Eigen::ArrayXd weights = Eigen::ArrayXd::LinSpaced(5, 1.0, 5.0);
    filter->setLogWeights((weights / weights.sum()).log());
    filter->resample({0, 1, 1, 3, 4});
    sail(*filter, turning, 60, 120);
  }
  const FilterSnapshot a = near.snapshot();
  const FilterSnapshot b = far.snapshot();
  ASSERT_GT(a.pings(), 80U);
  ASSERT_EQ(b.pings(), a.pings());
  for (std::size_t i = 0; i < a.pings(); i += 10) {
    const SurveyPing p = a.survey(i, 1).front();
    const SurveyPing q = b.survey(i, 1).front();
    EXPECT_NEAR(q.estimate.x_m - kFar_m, p.estimate.x_m, 1e-6);
    EXPECT_NEAR(q.estimate.y_m + kFar_m, p.estimate.y_m, 1e-6);
    EXPECT_NEAR(q.estimate.yaw_rad, p.estimate.yaw_rad, 1e-9);
    EXPECT_LT((q.covariance - p.covariance).cwiseAbs().maxCoeff(), 1e-5) << i;
    EXPECT_LT((q.record.online_covariance - p.record.online_covariance).cwiseAbs().maxCoeff(), 1e-5)
        << i;
  }
  // on the wire, relative to the origin, as float32: within its spacing at 100 m
  for (std::size_t j = 0; j < 5; ++j) {
    const std::vector<PlacedBeam> beams_near = drawFrom(near, j, 50);
    const std::vector<PlacedBeam> beams_far = drawFrom(far, j, 50);
    const std::vector<PlacedBeam> block_near = blockFrom(near, j, 0, 50);
    const std::vector<PlacedBeam> block_far = blockFrom(far, j, 0, 50);
    for (std::size_t i = 0; i < 50; ++i) {
      EXPECT_NEAR(beams_far[i].x_m, beams_near[i].x_m, 2e-5);
      EXPECT_NEAR(beams_far[i].y_m, beams_near[i].y_m, 2e-5);
      EXPECT_NEAR(block_far[i].x_m, block_near[i].x_m, 2e-5);
      EXPECT_NEAR(block_far[i].y_m, block_near[i].y_m, 2e-5);
    }
  }
}

// ---- particles -----------------------------------------------------------------------------

LoopClosingParams robustRule(double threshold) {
  LoopClosingParams params;
  params.resample_when = OnEffectiveSizeDrop{threshold};
  return params;
}

// Sails and closes loops, for six prompts.
void sailAndPrompt(ParticleFilter* filter, LoopClosing* closing) {
  for (int s = 0; s < 60; s += 10) {
    sail(*filter, turning, s, s + 10);
    const StepResult result = closing->step();
    ASSERT_TRUE(result.outcome == StepOutcome::kPrompted ||
                result.outcome == StepOutcome::kResampled)
        << result.problem;
    ASSERT_TRUE(filter->snapshot().logWeights().allFinite());
  }
}

void expectFinite(const ParticleFilter& filter) {
  const Estimate estimate = filter.snapshot().estimate();
  EXPECT_TRUE(std::isfinite(estimate.mean.x_m) && std::isfinite(estimate.mean.yaw_rad));
  EXPECT_TRUE(estimate.covariance.allFinite());
  for (const SurveyPing& ping : filter.snapshot().survey(0, filter.snapshot().pings())) {
    ASSERT_TRUE(std::isfinite(ping.estimate.x_m) && ping.covariance.allFinite());
  }
}

TEST(OneParticle, GoesThroughAllThatManyDo) {
  for (const double threshold : {0.5, 1.0}) {
    ParticleFilter filter(noisyParams(1));
    FakeMaps maps(1, 1);
    LoopClosing closing(filter, maps, robustRule(threshold));
    sailAndPrompt(&filter, &closing);
    EXPECT_EQ(closing.statistics().prompts, 6U);
    EXPECT_NEAR(filter.snapshot().logWeights()(0), 0.0, 1e-12);
    filter.resample({0});
    PastCorrection correction;
    correction.of_pings = {{0, {0.1, -0.1, 0.01}},
                           {filter.snapshot().pings() - 1, {0.1, -0.1, 0.01}}};
    filter.correctPast(correction);
    Fix fix{58.0, {0.0, 0.0}, Eigen::Matrix2d::Identity()};
    const Pose2 at = filter.snapshot().estimate().mean;
    fix.position_m = {at.x_m, at.y_m};
    filter.addFix(fix);
    closing.step();
    expectFinite(filter);
  }
}

// Without any noise: weights stay equal, however often they are asked.
TEST(IdenticalParticles, KeepEqualWeights) {
  ParticleFilter filter(quietParams(8));
  FakeMaps maps(8);
  LoopClosing closing(filter, maps, robustRule(1.0));
  sailAndPrompt(&filter, &closing);
  EXPECT_EQ(closing.epoch(), 0U) << "resampled for rounding";
  EXPECT_LT((filter.snapshot().logWeights().exp() - 0.125).abs().maxCoeff(), 1e-12);
  EXPECT_NEAR(effectiveParticles(filter.snapshot().logWeights().exp()), 8.0, 1e-9);
  expectFinite(filter);
}

TEST(EqualWeights, HaveOneOffspringEachWhateverIsDrawn) {
  for (const Eigen::Index particles : {1, 3, 7, 40, 1000}) {
    const Eigen::ArrayXd weights =
        normalisedWeights(Eigen::ArrayXd::Constant(particles, -1234.5678));
    for (const double u : {0.0, 1e-300, 0.25, 0.5, 1.0 - 1e-6, std::nextafter(1.0, 0.0)}) {
      const std::vector<std::uint32_t> offspring = systematicOffspring(weights, u);
      EXPECT_EQ(std::accumulate(offspring.begin(), offspring.end(), 0), particles);
      if (u < 1e-9 || u > 1.0 - 1e-9) continue;  // rounding decides to whom a tooth belongs
      for (const std::uint32_t count : offspring) ASSERT_EQ(count, 1U) << particles << " at " << u;
    }
  }
}

// ---- likelihoods ---------------------------------------------------------------------------

TEST_F(LoopClosingTest, LikelihoodsThatAllVanishAreAFailureAndChangeNothing) {
  for (const double absurd_m : {1e160, -1e200}) {  // its square is infinite
    maps.on_predict = [&](PingPrediction* p) { p->mean_m.setConstant(absurd_m); };
    const StepResult result = closing.step();
    EXPECT_EQ(result.outcome, StepOutcome::kFailed);
    EXPECT_NE(result.problem.find("largest log weight is -inf"), std::string::npos)
        << result.problem;
    EXPECT_TRUE(weightsAreUniform());
    sailOn();
  }
  EXPECT_EQ(closing.statistics().prompts_failed, 2U);
  maps.on_predict = nullptr;
  EXPECT_EQ(closing.step().outcome, StepOutcome::kPrompted);
}

TEST_F(LoopClosingTest, ALikelihoodThatVanishesTakesItsParticleAlone) {
  maps.on_predict = [](PingPrediction* p) { p->mean_m.row(2).setConstant(1e200); };
  EXPECT_EQ(closing.step().outcome, StepOutcome::kPrompted);
  EXPECT_TRUE(filter.snapshot().logWeights().allFinite());
  EXPECT_LT(weights()(2), 1e-300);
  EXPECT_NEAR(weights().sum(), 1.0, 1e-12);
}

TEST(RobustRule, OfMapsThatAreAllAbsurdIsAVeto) {
  PingPrediction maps{Eigen::ArrayXXd::Constant(3, 8, 1e200), Eigen::ArrayXXd::Constant(3, 8, 0.04),
                      Eigen::ArrayXd::Constant(3, 4.0)};
  const Eigen::ArrayXd z_m = Eigen::ArrayXd::Constant(8, -20.0);
  EXPECT_EQ(pingLikelihood(z_m, maps, {}).outcome, PromptOutcome::kVetoed);
  maps.mean_m.setConstant(-20.0);
  maps.mean_m.row(1).setConstant(1e200);
  const PingLikelihood likelihood = pingLikelihood(z_m, maps, {});
  EXPECT_EQ(likelihood.outcome, PromptOutcome::kWeighted);
  const WeightUpdate update = updateWeights(Eigen::ArrayXd::Constant(3, std::log(1.0 / 3.0)),
                                            likelihood.log_likelihood, {});
  EXPECT_TRUE(update.log_weights.allFinite());
}

TEST(RobustRule, OfLikelihoodsThatAllVanishIsRefused) {
  const Eigen::ArrayXd weights = Eigen::ArrayXd::Constant(3, std::log(1.0 / 3.0));
  for (const double bad : {-kInfinite, kInfinite, std::nan("")}) {
    EXPECT_THROW(updateWeights(weights, Eigen::ArrayXd::Constant(3, bad), {}), std::domain_error);
  }
}

}  // namespace
}  // namespace rbpf_core
