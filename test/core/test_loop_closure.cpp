#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "rbpf_core/loop_closure.hpp"
#include "rbpf_core/random.hpp"
#include "rbpf_core/resampling.hpp"

namespace rbpf_core {
namespace {

constexpr double kPrior_m2 = 4.0;
constexpr double kMapped_m2 = 0.05;   // well below a quarter of the prior
constexpr double kUnmapped_m2 = 3.9;  // hardly below the prior

LoopClosureParams productRule() {
  LoopClosureParams params;
  params.rule = WeightRule::kProduct;
  return params;
}

// J maps that all predict a ping of n beams at -20 m, one as surely as the other.
struct Prompt {
  Prompt(Eigen::Index particles, Eigen::Index beams)
      : z_m(Eigen::ArrayXd::Constant(beams, -20.0)),
        maps{Eigen::ArrayXXd::Constant(particles, beams, -20.0),
             Eigen::ArrayXXd::Constant(particles, beams, kMapped_m2),
             Eigen::ArrayXd::Constant(particles, kPrior_m2)} {}

  PingLikelihood likelihood(const LoopClosureParams& params = {}) const {
    return pingLikelihood(z_m, maps, params);
  }

  Eigen::ArrayXd z_m;
  PingPrediction maps;
};

Prompt randomPrompt(Eigen::Index particles, Eigen::Index beams) {
  RandomStream stream(1);
  Prompt prompt(particles, beams);
  for (double& z : prompt.z_m) z += stream.uniform() - 0.5;
  for (double& mean : prompt.maps.mean_m.reshaped()) mean += stream.uniform() - 0.5;
  for (double& variance : prompt.maps.variance_m2.reshaped()) variance *= 0.1 + stream.uniform();
  return prompt;
}

// ---- the paper's product rule ------------------------------------------------------------------

TEST(ProductRule, IsTheSumOfLogNormalsWithQAddedOnce) {
  const Prompt prompt = randomPrompt(4, 30);
  LoopClosureParams params = productRule();
  params.noise_std_m = 0.7;
  const PingLikelihood likelihood = prompt.likelihood(params);
  EXPECT_EQ(likelihood.outcome, PromptOutcome::kWeighted);
  for (Eigen::Index j = 0; j < 4; ++j) {
    double expected = 0.0;
    for (Eigen::Index i = 0; i < 30; ++i) {
      const double variance = prompt.maps.variance_m2(j, i) + 0.7 * 0.7;
      const double residual = prompt.z_m(i) - prompt.maps.mean_m(j, i);
      expected += std::log(std::exp(-0.5 * residual * residual / variance) /
                           std::sqrt(2.0 * M_PI * variance));
    }
    EXPECT_NEAR(likelihood.log_likelihood(j), expected, 1e-11);  // 30 rounded sums of order 1
  }
}

TEST(ProductRule, UsesEveryBeam) {
  const Prompt prompt = randomPrompt(1, 50);
  const double before = prompt.likelihood(productRule()).log_likelihood(0);
  for (Eigen::Index i = 0; i < 50; ++i) {
    Prompt other = prompt;
    other.maps.mean_m(0, i) = other.z_m(i) + 3.0;
    EXPECT_LT(other.likelihood(productRule()).log_likelihood(0), before - 1.0) << "beam " << i;
  }
}

// exp(-0.5 (1 m)^2 / 0.14 m^2) to the power of 2,000 is far below the smallest double.
TEST(ProductRule, DoesNotUnderflowOverThousandsOfBeams) {
  Prompt prompt(3, 2000);
  prompt.maps.mean_m.row(0) += 1.0;
  prompt.maps.mean_m.row(1) += 1.01;
  prompt.maps.mean_m.row(2) += 1.0;
  const PingLikelihood likelihood = prompt.likelihood(productRule());
  EXPECT_TRUE(likelihood.log_likelihood.allFinite());
  EXPECT_LT(likelihood.log_likelihood.maxCoeff(), -1000.0);
  const Eigen::ArrayXd before = Eigen::ArrayXd::Constant(3, -std::log(3.0));
  const WeightUpdate update = updateWeights(before, likelihood.log_likelihood, productRule());
  EXPECT_TRUE(update.log_weights.allFinite());
  EXPECT_NEAR(std::exp(update.log_weights(0)), 0.5, 1e-9);  // both equal, the third has vanished
  EXPECT_NEAR(std::exp(update.log_weights(2)), 0.5, 1e-9);
}

TEST(ProductRule, TakesPartsOfAPingAsWellAsTheWhole) {
  const Prompt whole = randomPrompt(3, 40);
  Eigen::ArrayXd sum = Eigen::ArrayXd::Zero(3);
  for (const Eigen::Index first : {0, 20}) {
    Prompt half = whole;
    half.z_m = whole.z_m.segment(first, 20);
    half.maps.mean_m = whole.maps.mean_m.middleCols(first, 20);
    half.maps.variance_m2 = whole.maps.variance_m2.middleCols(first, 20);
    sum += half.likelihood(productRule()).log_likelihood;
  }
  EXPECT_TRUE(sum.isApprox(whole.likelihood(productRule()).log_likelihood, 1e-12));
}

// ---- the robust rule ---------------------------------------------------------------------------

TEST(RobustRule, IsTheScaledMeanOfStudentTLogLikelihoods) {
  Prompt prompt(2, 10);
  prompt.maps.mean_m.row(0) += 0.4;
  prompt.maps.mean_m.row(1) -= 0.8;
  LoopClosureParams params;
  params.noise_std_m = 0.3;
  params.effective_beams = 12.0;
  params.student_t_dof = 3.0;
  const PingLikelihood likelihood = prompt.likelihood(params);
  const double scale2 = kMapped_m2 + 0.09;
  EXPECT_EQ(likelihood.outcome, PromptOutcome::kWeighted);
  EXPECT_DOUBLE_EQ(likelihood.overlap, 1.0);
  EXPECT_NEAR(likelihood.log_likelihood(0), -12.0 * 2.0 * std::log1p(0.16 / (3.0 * scale2)), 1e-12);
  EXPECT_NEAR(likelihood.log_likelihood(1), -12.0 * 2.0 * std::log1p(0.64 / (3.0 * scale2)), 1e-12);
  EXPECT_NEAR(likelihood.best_innovation, 0.4 / std::sqrt(scale2), 1e-12);
}

TEST(RobustRule, GivesAShiftedParticleLessWeight) {
  constexpr Eigen::Index kBeams = 64;
  Prompt prompt(5, kBeams);
  // the seabed is a dune; particle j sees it shifted by j metres
  for (Eigen::Index i = 0; i < kBeams; ++i) {
    prompt.z_m(i) = -20.0 + std::sin(0.3 * static_cast<double>(i));
    for (Eigen::Index j = 0; j < 5; ++j) {
      prompt.maps.mean_m(j, i) = -20.0 + std::sin(0.3 * static_cast<double>(i + j));
    }
  }
  const Eigen::ArrayXd log_likelihood = prompt.likelihood().log_likelihood;
  for (Eigen::Index j = 1; j < 5; ++j) EXPECT_LT(log_likelihood(j), log_likelihood(j - 1));
}

TEST(RobustRule, UsesEveryBeam) {
  const Prompt prompt(3, 50);
  const double before = prompt.likelihood().log_likelihood(0);
  for (Eigen::Index i = 0; i < 50; ++i) {
    Prompt other = prompt;
    other.maps.mean_m(0, i) += 1.0;
    EXPECT_LT(other.likelihood().log_likelihood(0), before - 0.1) << "beam " << i;
  }
}

TEST(RobustRule, CountsAPingAsManyBeamsAsItIsWorthNotAsItHas) {
  Prompt few(2, 16);
  Prompt many(2, 256);
  few.maps.mean_m.row(1) += 0.5;
  many.maps.mean_m.row(1) += 0.5;
  EXPECT_TRUE(few.likelihood().log_likelihood.isApprox(many.likelihood().log_likelihood, 1e-12));
}

TEST(RobustRule, CountsAPingLessTheLessOfItLiesOverMappedSeabed) {
  Prompt whole(2, 40);
  whole.maps.mean_m.row(1) += 0.5;
  Prompt half = whole;
  half.maps.variance_m2.rightCols(20).setConstant(kUnmapped_m2);
  EXPECT_TRUE(
      (2.0 * half.likelihood().log_likelihood).isApprox(whole.likelihood().log_likelihood, 1e-12));
}

// Equal residuals: whoever overlaps more must neither gain nor lose by it.
TEST(RobustRule, OverlapNeitherAttractsNorRepels) {
  for (const double residual_m : {0.0, 0.2, 0.8}) {
    Prompt prompt(3, 40);
    prompt.maps.mean_m += residual_m;
    prompt.maps.variance_m2.row(1).tail(10).setConstant(kUnmapped_m2);
    prompt.maps.variance_m2.row(2).tail(25).setConstant(kUnmapped_m2);
    prompt.maps.mean_m.row(2).tail(25) += 5.0;  // a guess that does not vote
    const PingLikelihood likelihood = prompt.likelihood();
    EXPECT_EQ(likelihood.outcome, PromptOutcome::kWeighted);
    EXPECT_NEAR(likelihood.overlap, 85.0 / 120.0, 1e-12);
    EXPECT_NEAR(likelihood.log_likelihood(1), likelihood.log_likelihood(0), 1e-12);
    EXPECT_NEAR(likelihood.log_likelihood(2), likelihood.log_likelihood(0), 1e-12);
  }
}

TEST(RobustRule, DoesNotRewardAMapForBeingSurer) {
  Prompt prompt(2, 40);
  prompt.maps.mean_m += 0.2;
  prompt.maps.variance_m2.row(1) *= 4.0;  // still mapped
  const Eigen::ArrayXd log_likelihood = prompt.likelihood().log_likelihood;
  EXPECT_NEAR(log_likelihood(0), log_likelihood(1), 1e-12);
}

TEST(RobustRule, GivesAParticleWithHardlyAnyVoteTheMedianOfTheOthers) {
  Prompt prompt(6, 40);
  for (Eigen::Index j = 0; j < 5; ++j) prompt.maps.mean_m.row(j) += 0.1 * static_cast<double>(j);
  // 5 of 40 beams are less than half of the least overlap, 0.3; and those fit perfectly
  prompt.maps.variance_m2.row(5).tail(35).setConstant(kUnmapped_m2);
  const Eigen::ArrayXd log_likelihood = prompt.likelihood().log_likelihood;
  EXPECT_DOUBLE_EQ(log_likelihood(5), log_likelihood(2));
  EXPECT_LT(log_likelihood(5), log_likelihood(1));
  EXPECT_GT(log_likelihood(5), log_likelihood(3));
}

TEST(RobustRule, SaysNothingOverSeabedThatIsNotMapped) {
  Prompt prompt(2, 40);
  prompt.maps.variance_m2.rightCols(29).setConstant(kUnmapped_m2);  // 27.5 % overlap
  EXPECT_EQ(prompt.likelihood().outcome, PromptOutcome::kLittleOverlap);
  EXPECT_NEAR(prompt.likelihood().overlap, 11.0 / 40.0, 1e-12);
  prompt.maps.variance_m2.col(11).setConstant(kMapped_m2);  // 30 %
  prompt.maps.variance_m2.col(12).setConstant(kMapped_m2);
  EXPECT_EQ(prompt.likelihood().outcome, PromptOutcome::kWeighted);
}

TEST(RobustRule, MeasuresWhatIsMappedAgainstEachMapsOwnPrior) {
  LoopClosureParams params;
  params.mapped_variance = 0.25;
  Prompt prompt(2, 40);
  prompt.maps.variance_m2.setConstant(0.5);
  EXPECT_EQ(prompt.likelihood(params).outcome, PromptOutcome::kWeighted);
  prompt.maps.prior_variance_m2.setConstant(1.0);  // 0.5 is now half of the prior
  EXPECT_EQ(prompt.likelihood(params).outcome, PromptOutcome::kLittleOverlap);
}

TEST(RobustRule, VetoesAPingThatNoParticleExplains) {
  Prompt prompt(3, 40);
  prompt.maps.mean_m += 2.0;  // 5.3 sigma
  const PingLikelihood likelihood = prompt.likelihood();
  EXPECT_EQ(likelihood.outcome, PromptOutcome::kVetoed);
  EXPECT_NEAR(likelihood.best_innovation, 2.0 / std::sqrt(kMapped_m2 + 0.09), 1e-12);
  prompt.maps.mean_m.row(1) -= 2.0;  // one particle does
  EXPECT_EQ(prompt.likelihood().outcome, PromptOutcome::kWeighted);
  EXPECT_NEAR(prompt.likelihood().best_innovation, 0.0, 1e-12);
}

TEST(RobustRule, IsNotRuledByASingleOutlier) {
  Prompt prompt(2, 40);
  prompt.z_m(7) += 50.0;             // a fish
  prompt.maps.mean_m.row(1) += 0.5;  // a particle that is off everywhere,
  prompt.maps.mean_m(1, 7) += 10.0;  // but closer to the fish
  const Eigen::ArrayXd robust = prompt.likelihood().log_likelihood;
  const Eigen::ArrayXd product = prompt.likelihood(productRule()).log_likelihood;
  EXPECT_GT(robust(0), robust(1));
  EXPECT_LT(product(0), product(1));  // what a Gaussian makes of it
}

// ---- malformed predictions ---------------------------------------------------------------------

TEST(PingLikelihood, RefusesMalformedPredictions) {
  const double nan = std::nan("");
  const double infinity = std::numeric_limits<double>::infinity();
  const auto expectRefused = [](const char* what, const auto& spoil) {
    Prompt prompt(3, 10);
    spoil(prompt);
    for (const LoopClosureParams& params : {LoopClosureParams(), productRule()}) {
      EXPECT_THROW(prompt.likelihood(params), std::invalid_argument) << what;
    }
  };
  expectRefused("a beam too few", [](Prompt& p) { p.z_m = p.z_m.head(9).eval(); });
  expectRefused("means of a beam too few",
                [](Prompt& p) { p.maps.mean_m = p.maps.mean_m.leftCols(9).eval(); });
  expectRefused("variances of a beam too few",
                [](Prompt& p) { p.maps.variance_m2 = p.maps.variance_m2.leftCols(9).eval(); });
  expectRefused("variances of a particle too few",
                [](Prompt& p) { p.maps.variance_m2 = p.maps.variance_m2.topRows(2).eval(); });
  expectRefused("priors of a particle too few", [](Prompt& p) {
    p.maps.prior_variance_m2 = p.maps.prior_variance_m2.head(2).eval();
  });
  expectRefused("mean NaN", [&](Prompt& p) { p.maps.mean_m(1, 3) = nan; });
  expectRefused("mean infinite", [&](Prompt& p) { p.maps.mean_m(1, 3) = infinity; });
  expectRefused("variance NaN", [&](Prompt& p) { p.maps.variance_m2(2, 9) = nan; });
  expectRefused("variance infinite", [&](Prompt& p) { p.maps.variance_m2(2, 9) = infinity; });
  expectRefused("variance negative", [](Prompt& p) { p.maps.variance_m2(0, 0) = -1e-6; });
  expectRefused("prior NaN", [&](Prompt& p) { p.maps.prior_variance_m2(1) = nan; });
  expectRefused("prior not positive", [](Prompt& p) { p.maps.prior_variance_m2(1) = 0.0; });
}

// ---- the update of the weights -----------------------------------------------------------------

Eigen::ArrayXd uniformLogWeights(Eigen::Index particles) {
  return Eigen::ArrayXd::Constant(particles, -std::log(static_cast<double>(particles)));
}

double nEff(const Eigen::ArrayXd& log_weights) { return effectiveParticles(log_weights.exp()); }

TEST(UpdateWeights, IsBayesRuleWhenNoTemperingIsNeeded) {
  Eigen::ArrayXd before(3);
  before << std::log(0.2), std::log(0.5), std::log(0.3);
  Eigen::ArrayXd log_likelihood(3);
  log_likelihood << std::log(2.0), std::log(1.0), std::log(3.0);
  const WeightUpdate update = updateWeights(before, log_likelihood - 1e4, {});
  EXPECT_EQ(update.tempering, 1.0);
  EXPECT_NEAR(std::exp(update.log_weights(0)), 0.4 / 1.8, 1e-11);  // 1e4 costs four digits
  EXPECT_NEAR(std::exp(update.log_weights(1)), 0.5 / 1.8, 1e-11);
  EXPECT_NEAR(std::exp(update.log_weights(2)), 0.9 / 1.8, 1e-11);
}

TEST(UpdateWeights, AppliesTheGivenExponent) {
  Eigen::ArrayXd log_likelihood(2);
  log_likelihood << 0.0, std::log(16.0);
  LoopClosureParams params = productRule();
  params.tempering = 0.25;
  const WeightUpdate update = updateWeights(uniformLogWeights(2), log_likelihood, params);
  EXPECT_EQ(update.tempering, 0.25);
  EXPECT_NEAR(std::exp(update.log_weights(1)), 2.0 / 3.0, 1e-12);
}

TEST(UpdateWeights, TempersToTheTargetAndNoFurther) {
  constexpr Eigen::Index kParticles = 40;
  RandomStream stream(1);
  for (int trial = 0; trial < 50; ++trial) {
    Eigen::ArrayXd log_likelihood(kParticles);
    for (double& value : log_likelihood) value = -3000.0 * stream.uniform();
    const WeightUpdate update = updateWeights(uniformLogWeights(kParticles), log_likelihood, {});
    EXPECT_LT(update.tempering, 1.0);
    EXPECT_NEAR(nEff(update.log_weights), 10.0, 1e-6);  // tau is found to 1e-12, times 3,000
    EXPECT_GE(nEff(update.log_weights), 10.0 - 1e-9);
    EXPECT_NEAR(update.log_weights.exp().sum(), 1.0, 1e-12);
  }
}

TEST(UpdateWeights, KeepsNEffWhereItWasIfThatIsBelowTheTarget) {
  Eigen::ArrayXd before = Eigen::ArrayXd::Constant(40, std::log(1e-3));
  before.head(4).setConstant(std::log((1.0 - 0.036) / 4.0));  // N_eff 4.3, target 10
  Eigen::ArrayXd log_likelihood = Eigen::ArrayXd::Zero(40);
  log_likelihood(0) = 100.0;
  const WeightUpdate update = updateWeights(before, log_likelihood, {});
  EXPECT_GE(nEff(update.log_weights), nEff(before) - 1e-9);
}

TEST(UpdateWeights, DoesNotTemperTheProductRule) {
  for (const Eigen::Index particles : {2, 7, 10, 11}) {  // vectorised and scalar exponentials alike
    Eigen::ArrayXd log_likelihood = Eigen::ArrayXd::Zero(particles);
    log_likelihood(1) = 1e5;
    const WeightUpdate update =
        updateWeights(uniformLogWeights(particles), log_likelihood, productRule());
    EXPECT_EQ(update.tempering, 1.0);
    EXPECT_NEAR(nEff(update.log_weights), 1.0, 1e-12);
    EXPECT_TRUE(update.log_weights.allFinite());  // vanished weights stay numbers
  }
}

TEST(UpdateWeights, CarriesWeightsOverFromPromptToPrompt) {
  Eigen::ArrayXd log_likelihood(2);
  log_likelihood << 0.0, std::log(2.0);
  WeightUpdate update{uniformLogWeights(2), 1.0};
  for (int prompt = 0; prompt < 3; ++prompt) {
    update = updateWeights(update.log_weights, log_likelihood, productRule());
  }
  EXPECT_NEAR(std::exp(update.log_weights(1)), 8.0 / 9.0, 1e-12);
}

}  // namespace
}  // namespace rbpf_core
