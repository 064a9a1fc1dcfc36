// What weights and resampling make of a seabed that shows some directions and hides others: the
// rule for the weights, tempering, the N_eff rule and the resampling together, as in Algorithm 2.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

#include "rbpf_core/random.hpp"
#include "rbpf_core/resampling.hpp"
#include "rbpf_core/weighting.hpp"

namespace rbpf_core {
namespace {

constexpr Eigen::Index kSlopeParticles = 100;
constexpr Eigen::Index kBeams = 32;
constexpr int kPrompts = 60;
constexpr double kStep_m = 0.1;  // of the wander between two prompts, along x and y alike
constexpr double kSonarStd_m = 0.1;

using Seabed = std::function<double(double x_m, double y_m)>;

double slopeAcrossX(double x_m, double) { return 0.2 * x_m; }
double flat(double, double) { return 0.0; }
double unseen(double x_m, double y_m) { return std::sin(x_m) + std::cos(y_m); }
double reliefOfBoth(double x_m, double y_m) { return std::sin(0.3 * x_m) + std::sin(0.35 * y_m); }

// Particles that stay where they are but for their wander, over a seabed that all maps know alike.
struct StillSurvey {
  explicit StillSurvey(std::uint64_t seed) : stream(seed) {}

  double normal(double std) { return std::normal_distribution<double>(0.0, std)(stream); }

  void prompt(const Seabed& seabed, double variance_m2) {
    x_m = x_m.unaryExpr([&](double x) { return x + normal(kStep_m); });
    y_m = y_m.unaryExpr([&](double y) { return y + normal(kStep_m); });
    true_x_m += normal(kStep_m);
    true_y_m += normal(kStep_m);
    const double depth_error_m = normal(kSonarStd_m);  // of the map: all beams share it
    Eigen::ArrayXd z_m(kBeams);
    PingPrediction maps{Eigen::ArrayXXd(kSlopeParticles, kBeams),
                        Eigen::ArrayXXd::Constant(kSlopeParticles, kBeams, variance_m2),
                        Eigen::ArrayXd::Constant(kSlopeParticles, 1.0)};
    for (Eigen::Index i = 0; i < kBeams; ++i) {
      const double across_m = static_cast<double>(i - kBeams / 2);
      const double x_off_m = 0.6 * across_m, y_off_m = 0.8 * across_m;
      z_m(i) = seabed(true_x_m + x_off_m, true_y_m + y_off_m) + depth_error_m + normal(kSonarStd_m);
      for (Eigen::Index j = 0; j < kSlopeParticles; ++j) {
        maps.mean_m(j, i) = seabed(x_m(j) + x_off_m, y_m(j) + y_off_m);
      }
    }
    weigh(z_m, maps);
  }

  void weigh(const Eigen::ArrayXd& z_m, const PingPrediction& maps) {
    const PingLikelihood likelihood = pingLikelihood(z_m, maps, {});
    if (likelihood.outcome == PromptOutcome::kWeighted) {
      log_weights = updateWeights(log_weights, likelihood.log_likelihood, {}).log_weights;
    }
    const Eigen::ArrayXd weights = log_weights.exp();
    if (!OnEffectiveSizeDrop{}(weights)) return;
    ++resamplings;
    const auto ancestors = numberOffspring(systematicOffspring(weights, stream.uniform()),
                                           std::vector<std::uint32_t>(kSlopeParticles, 0));
    const Eigen::ArrayXd old_x_m = x_m, old_y_m = y_m;
    for (Eigen::Index j = 0; j < kSlopeParticles; ++j) {
      x_m(j) = old_x_m(ancestors[static_cast<std::size_t>(j)]);
      y_m(j) = old_y_m(ancestors[static_cast<std::size_t>(j)]);
    }
    log_weights.setConstant(-std::log(static_cast<double>(kSlopeParticles)));
  }

  double mean(const Eigen::ArrayXd& of) const { return (log_weights.exp() * of).sum(); }
  double variance(const Eigen::ArrayXd& of) const {
    return (log_weights.exp() * (of - mean(of)).square()).sum();
  }

  RandomStream stream;
  Eigen::ArrayXd x_m = Eigen::ArrayXd::Zero(kSlopeParticles);
  Eigen::ArrayXd y_m = Eigen::ArrayXd::Zero(kSlopeParticles);
  Eigen::ArrayXd log_weights =
      Eigen::ArrayXd::Constant(kSlopeParticles, -std::log(static_cast<double>(kSlopeParticles)));
  double true_x_m = 0.0, true_y_m = 0.0;
  int resamplings = 0;
};

// Means over some surveys.
struct Outcome {
  double along_variance_m2 = 0.0, across_variance_m2 = 0.0;
  double across_error2_m2 = 0.0;
  double resampling_share = 0.0;
};

Outcome survey(const Seabed& seabed, double variance_m2 = 1e-3, unsigned surveys = 20) {
  Outcome outcome;
  for (std::uint64_t seed = 1; seed <= surveys; ++seed) {
    StillSurvey one(seed);
    for (int prompt = 0; prompt < kPrompts; ++prompt) one.prompt(seabed, variance_m2);
    outcome.along_variance_m2 += one.variance(one.y_m) / surveys;
    outcome.across_variance_m2 += one.variance(one.x_m) / surveys;
    outcome.across_error2_m2 += std::pow(one.mean(one.x_m) - one.true_x_m, 2) / surveys;
    outcome.resampling_share += one.resamplings / double{kPrompts} / surveys;
  }
  return outcome;
}

constexpr double kWandered_m2 = kPrompts * kStep_m * kStep_m;  // of a particle nobody weighs

TEST(Observability, ASeabedThatTellsNothingChangesNoWeight) {
  const Outcome flat_one = survey(flat);
  EXPECT_EQ(flat_one.resampling_share, 0.0);
  // 20 surveys of 100 particles each: a variance is known to 0.03 of itself
  EXPECT_NEAR(flat_one.along_variance_m2, kWandered_m2, 0.1 * kWandered_m2);
  EXPECT_NEAR(flat_one.across_variance_m2, kWandered_m2, 0.1 * kWandered_m2);
}

TEST(Observability, SeabedThatIsNotMappedChangesNoWeight) {
  const Outcome unmapped = survey(unseen, 0.9);
  EXPECT_EQ(unmapped.resampling_share, 0.0);
  EXPECT_NEAR(unmapped.across_variance_m2, kWandered_m2, 0.1 * kWandered_m2);
}

TEST(Observability, OnAStraightSlopeTheSpreadShrinksAcrossItAndGrowsAlongIt) {
  const Outcome slope = survey(slopeAcrossX);
  EXPECT_LT(slope.across_variance_m2, 0.3 * kWandered_m2);
  // Resampling for what the slope tells thins out the other direction, too, but must not exhaust
  // it.
  EXPECT_GT(slope.along_variance_m2, 0.5 * kWandered_m2);
  EXPECT_LT(slope.resampling_share, 0.5);
}

// The mean of 100 squared errors is within 1.4 of its expectation (3 sigma); the rest is what 100
// particles lose. Counted as 30 beams, pings make it 2.3 on the slope.
TEST(Observability, TheSpreadIsHardlySmallerThanTheErrorThoughBeamsShareTheirErrors) {
  for (const Seabed& seabed : {Seabed(slopeAcrossX), Seabed(reliefOfBoth)}) {
    const Outcome outcome = survey(seabed, 1e-3, 100);
    EXPECT_LT(outcome.across_error2_m2, 1.8 * outcome.across_variance_m2);
  }
}

}  // namespace
}  // namespace rbpf_core
