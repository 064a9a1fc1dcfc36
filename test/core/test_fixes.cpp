// Absolute fixes: when they are taken, when they are refused, and what they say of the particles.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "fake_maps.hpp"
#include "rbpf_core/loop_closing.hpp"
#include "survey.hpp"

namespace rbpf_core {
namespace {

Fix fixAt(double stamp_s, double x_m, double y_m, double std_m = 1.0) {
  return {stamp_s, {x_m, y_m}, std_m * std_m * Eigen::Matrix2d::Identity()};
}

// Why a fix is refused, and with what words; no reason if it is not.
struct Refused {
  std::optional<Reason> reason;
  std::string what;
};

Refused add(ParticleFilter& filter, const Fix& fix) {
  try {
    filter.addFix(fix);
  } catch (const Refusal& refusal) {
    return {refusal.reason(), refusal.what()};
  }
  return {};
}

void sailStraight(ParticleFilter& filter, int from_s, int to_s) {
  for (int s = from_s; s <= to_s; ++s) filter.addOdometry(straight(s));
}

// ---- in time -----------------------------------------------------------------------------------

TEST(FixInTime, IsLoggedWithDeadReckoningAtItsOwnStampThoughItComesLate) {
  ParticleFilter filter(quietParams());
  sailStraight(filter, 0, 9);
  EXPECT_EQ(add(filter, fixAt(2.25, 4.0, 0.5)).what, "");
  const FilterSnapshot snapshot = filter.snapshot();
  ASSERT_EQ(snapshot.fixes(), 1U);
  EXPECT_EQ(snapshot.fix(0).fix.stamp_s, 2.25);
  EXPECT_NEAR(snapshot.fix(0).dead_reckoning.x_m, 4.5, 1e-12);  // 2 m/s
}

TEST(FixInTime, WaitsForOdometryAtOrAfterItsStamp) {
  ParticleFilter filter(quietParams());
  EXPECT_EQ(add(filter, fixAt(1.5, 3.0, 0.0)).what, "");
  sailStraight(filter, 0, 1);
  EXPECT_EQ(filter.snapshot().fixes(), 0U);
  sailStraight(filter, 2, 2);
  EXPECT_EQ(filter.snapshot().fixes(), 1U);
  EXPECT_NEAR(filter.snapshot().fix(0).dead_reckoning.x_m, 3.0, 1e-12);
}

TEST(FixInTime, IsRefusedIfItsOdometryIsNotKeptAnyMore) {
  FilterParams params = quietParams();
  params.fixes.max_late_s = 80.0;
  ParticleFilter filter(params);
  sailStraight(filter, 0, 100);
  EXPECT_EQ(add(filter, fixAt(20.5, 41.0, 0.0)).what, "");
  const Refused refused = add(filter, fixAt(18.5, 37.0, 0.0));
  EXPECT_EQ(refused.reason, Reason::kNoOdometry);
  EXPECT_NE(refused.what.find("fixes/max_late_s"), std::string::npos) << refused.what;
}

TEST(FixInTime, IsRefusedWithinALongGapAndAfterTheEnd) {
  ParticleFilter filter(quietParams());
  sailStraight(filter, 0, 1);
  filter.addOdometry(straight(30.0));
  EXPECT_EQ(add(filter, fixAt(15.0, 30.0, 0.0)).reason, Reason::kInGap);
  EXPECT_EQ(add(filter, fixAt(31.0, 62.0, 0.0)).what, "");
  filter.finish();
  EXPECT_EQ(filter.snapshot().refused().dropped(InputKind::kFix), 2U);
  EXPECT_EQ(add(filter, fixAt(32.0, 64.0, 0.0)).reason, Reason::kSurveyOver);
  EXPECT_EQ(add(filter, fixAt(30.0, 60.0, 0.0)).reason, Reason::kSurveyOver);
}

// ---- what is refused ---------------------------------------------------------------------------

TEST(FixRefused, WhatIsNoPositionOrHasNoCovariance) {
  ParticleFilter filter(quietParams());
  sailStraight(filter, 0, 2);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(add(filter, fixAt(1.0, nan, 0.0)).reason, Reason::kNotFinite);
  EXPECT_EQ(add(filter, fixAt(1.0, 2.0, 0.0, 0.0)).reason, Reason::kMalformed);
  EXPECT_EQ(add(filter, fixAt(1.0, 2.0, 0.0, 1e5)).reason, Reason::kMalformed);
  Fix fix = fixAt(1.0, 2.0, 0.0);
  fix.covariance_m2 << 1.0, 2.0, 2.0, 1.0;
  const Refused refused = add(filter, fix);
  EXPECT_EQ(refused.reason, Reason::kMalformed);
  EXPECT_NE(refused.what.find("((1.000, 2.000), (2.000, 1.000)) m^2, expected a positive definite"),
            std::string::npos)
      << refused.what;
  EXPECT_EQ(filter.snapshot().fixes(), 0U);
  EXPECT_EQ(filter.snapshot().refused().rejected(InputKind::kFix), 4U);
}

TEST(FixRefused, TheSameOneAgain) {
  ParticleFilter filter(quietParams());
  sailStraight(filter, 0, 2);
  EXPECT_EQ(add(filter, fixAt(1.0, 2.0, 0.0)).what, "");
  EXPECT_EQ(add(filter, fixAt(1.0, 2.0, 0.0)).reason, Reason::kDuplicateStamp);
  EXPECT_EQ(add(filter, fixAt(1.0, 2.1, 0.0)).what, "");  // another source
}

TEST(FixRefused, WhatContradictsTheOdometryWithTheFigures) {
  FilterParams params = quietParams();
  params.fixes.drift_mps = 0.0;
  ParticleFilter filter(params);
  sailStraight(filter, 0, 10);
  EXPECT_EQ(add(filter, fixAt(10.0, 20.0, 4.9)).what, "");
  const Refused refused = add(filter, fixAt(10.0, 20.0, 50.0));
  EXPECT_EQ(refused.reason, Reason::kContradicts);
  EXPECT_NE(refused.what.find("lies 50.0 m from the estimate, 50.0 standard deviations of both, "
                              "expected at most 5.0"),
            std::string::npos)
      << refused.what;
  EXPECT_EQ(filter.snapshot().fixes(), 1U);
}

TEST(FixRefused, LessTheLongerThereHasBeenNone) {
  FilterParams params = quietParams();
  params.fixes.drift_mps = 0.1;
  ParticleFilter filter(params);
  sailStraight(filter, 0, 100);
  // after 100 s: sqrt(1 + 10^2) = 10.05 m of standard deviation
  EXPECT_EQ(add(filter, fixAt(100.0, 200.0, 51.0)).reason, Reason::kContradicts);
  EXPECT_EQ(add(filter, fixAt(100.0, 200.0, 50.0)).what, "");
  EXPECT_EQ(add(filter, fixAt(100.0, 200.0, 49.0)).what, "");  // the estimate is as it was
  KnownError with_a_fix{100.0, {200.0, 0.0, 0.0}, Eigen::Matrix3d::Zero(), 90.0};
  filter.setKnownError(with_a_fix);
  // sqrt(1 + 1) m
  EXPECT_EQ(add(filter, fixAt(100.0, 200.0, -7.2)).reason, Reason::kContradicts);
  EXPECT_EQ(add(filter, fixAt(100.0, 200.0, -7.0)).what, "");
}

TEST(FixRefused, LessWhereMoreIsNotKnown) {
  FilterParams params = quietParams();
  params.fixes.drift_mps = 0.0;
  ParticleFilter filter(params);
  sailStraight(filter, 0, 10);
  EXPECT_EQ(add(filter, fixAt(10.0, 20.0, 20.0)).reason, Reason::kContradicts);
  filter.setKnownError({10.0, {20.0, 0.0, 0.0}, 25.0 * Eigen::Matrix3d::Identity(), {}});
  EXPECT_EQ(add(filter, fixAt(10.0, 20.0, 20.0)).what, "");
}

// ---- weights -----------------------------------------------------------------------------------

TEST(FixWeights, AreTheStudentTDensitiesAtTheParticlesPosesAtItsStamp) {
  ParticleFilter filter(noisyParams(20));
  filter.addOdometry(straight(0.0));
  filter.addOdometry(straight(1.0));
  const std::vector<Pose2> before = filter.snapshot().particles();
  filter.addOdometry(straight(2.0));
  const std::vector<Pose2> after = filter.snapshot().particles();
  filter.addOdometry(straight(3.0));
  Fix fix = fixAt(1.25, 2.6, 0.1);
  fix.covariance_m2 << 0.3, 0.1, 0.1, 0.2;
  filter.addFix(fix);
  const auto to_weigh = filter.takeFixesToWeigh();
  ASSERT_EQ(to_weigh.size(), 1U);
  const Eigen::ArrayXd log_likelihood = fixLikelihood(fix, to_weigh[0].particles->poses);
  const auto density = [&](std::size_t j) {
    const double x = before[j].x_m + 0.25 * (after[j].x_m - before[j].x_m) - 2.6;
    const double y = before[j].y_m + 0.25 * (after[j].y_m - before[j].y_m) - 0.1;
    // the inverse of the covariance, by hand
    const double d2 = (0.2 * x * x - 2.0 * 0.1 * x * y + 0.3 * y * y) / (0.3 * 0.2 - 0.1 * 0.1);
    return std::pow(1.0 + d2 / 4.0, -3.0);
  };
  for (std::size_t j = 0; j < before.size(); ++j) {
    EXPECT_NEAR(log_likelihood(static_cast<Eigen::Index>(j)), std::log(density(j)), 1e-9);
  }
  EXPECT_TRUE(filter.takeFixesToWeigh().empty());
}

TEST(FixWeights, GoWithTheParticlesThroughAResampling) {
  ParticleFilter filter(noisyParams(5));
  sailStraight(filter, 0, 5);
  filter.addFix(fixAt(4.5, 9.0, 0.0));
  const std::vector<std::uint32_t> ancestors = {3, 3, 1, 0, 0};
  ParticleFilter same(noisyParams(5));
  sailStraight(same, 0, 5);
  same.addFix(fixAt(4.5, 9.0, 0.0));
  same.resample(ancestors);
  const auto before = filter.takeFixesToWeigh().at(0).particles->poses;
  const auto after = same.takeFixesToWeigh().at(0).particles->poses;
  for (std::size_t j = 0; j < 5; ++j) EXPECT_TRUE(after[j] == before[ancestors[j]]);
}

TEST(FixWeights, BringAResamplingWithoutAnyPrompt) {
  ParticleFilter filter(noisyParams(40));
  FakeMaps maps(40);
  LoopClosing loop_closing(filter, maps, {0.0, {}, OnEffectiveSizeDrop{0.9}});
  sailStraight(filter, 0, 100);
  EXPECT_EQ(loop_closing.step().outcome, StepOutcome::kNotDue);
  const Pose2 one = filter.snapshot().particles()[7];
  const Eigen::Vector2d there(one.x_m, one.y_m);
  const auto meanError = [&] {
    const Pose2 mean = filter.snapshot().estimate().mean;
    return std::hypot(mean.x_m - there.x(), mean.y_m - there.y());
  };
  const double before_m = meanError();
  filter.addFix(fixAt(100.0, there.x(), there.y(), 0.5));
  EXPECT_EQ(loop_closing.step().outcome, StepOutcome::kResampled);
  EXPECT_LT(meanError(), before_m);
  EXPECT_EQ(loop_closing.step().outcome, StepOutcome::kNotDue);
}

}  // namespace
}  // namespace rbpf_core
