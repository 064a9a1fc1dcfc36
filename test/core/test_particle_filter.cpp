// The filter's odometry, estimate, resampling and seeds; pings have a file of their own.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

#include "rbpf_core/particle_filter.hpp"
#include "rbpf_core/resampling.hpp"
#include "statistics.hpp"
#include "survey.hpp"

namespace rbpf_core {
namespace {

// ---- odometry ----------------------------------------------------------------------------------

TEST(ParticleFilter, KnowsNothingBeforeTheFirstOdometry) {
  const ParticleFilter filter(quietParams());
  EXPECT_TRUE(filter.snapshot().particles().empty());
  EXPECT_FALSE(filter.snapshot().latestPing().has_value());
  EXPECT_FALSE(filter.snapshot().latestPingStamp().has_value());
  EXPECT_TRUE(filter.snapshot().survey(0, 10).empty());
  EXPECT_EQ(filter.snapshot().pings(), 0U);
  PlacedBeam untouched{1.0F, 2.0F, 3.0F};
  EXPECT_EQ(filter.snapshot().drawMinibatch(0, 1, &untouched), 0U);
  EXPECT_EQ(untouched, (PlacedBeam{1.0F, 2.0F, 3.0F}));
}

TEST(ParticleFilter, StartsAtTheFirstOdometrysPose) {
  ParticleFilter filter(quietParams());
  filter.addOdometry(turning(100.0));
  for (const Pose2& pose : filter.snapshot().particles()) EXPECT_EQ(pose, (Pose2{5.0, 6.0, 0.3}));
}

TEST(ParticleFilter, StartsAtAGivenPoseInstead) {
  FilterParams params = quietParams();
  params.start_pose = Pose2{-100.0, 50.0, -2.0};
  ParticleFilter filter(params);
  filter.addOdometry(turning(0.0));
  for (const Pose2& pose : filter.snapshot().particles()) EXPECT_EQ(pose, *params.start_pose);
  EXPECT_EQ(filter.snapshot().estimate().dead_reckoning, *params.start_pose);
  EXPECT_EQ(filter.snapshot().estimate().odometry, (Pose2{5.0, 6.0, 0.3}));
}

TEST(ParticleFilter, SpreadsTheStartAsGiven) {
  constexpr Eigen::Index kParticles = 4000;
  FilterParams params = quietParams(static_cast<std::size_t>(kParticles));
  params.start_position_std_m = 2.0;
  params.start_yaw_std_rad = 0.1;
  ParticleFilter filter(params);
  filter.addOdometry(turning(0.0));
  Eigen::MatrixXd samples(kParticles, 3);
  const std::vector<Pose2> particles = filter.snapshot().particles();
  for (Eigen::Index j = 0; j < kParticles; ++j) {
    const Pose2& pose = particles[static_cast<std::size_t>(j)];
    samples.row(j) << pose.x_m - 5.0, pose.y_m - 6.0, pose.yaw_rad - 0.3;
  }
  const Moments seen = momentsOf(samples);
  const Eigen::Matrix3d expected = Eigen::Vector3d(4.0, 4.0, 0.01).asDiagonal();
  for (Eigen::Index a = 0; a < 3; ++a) {
    EXPECT_NEAR(seen.mean(a), 0.0, kStandardErrors * std::sqrt(expected(a, a) / kParticles));
    for (Eigen::Index b = 0; b <= a; ++b) {
      EXPECT_NEAR(seen.covariance(a, b), expected(a, b),
                  kStandardErrors * covarianceError(expected, a, b, kParticles));
    }
  }
}

TEST(ParticleFilter, DeadReckoningIsTheIntegrationWithoutNoise) {
  FilterParams params = noisyParams();
  params.start_position_std_m = 1.0;
  ParticleFilter filter(params);
  filter.addOdometry(turning(0.0));
  Pose2 expected{5.0, 6.0, 0.3};
  for (int k = 1; k <= 200; ++k) {
    expected = advance(expected, motionBetween(turning(0.1 * (k - 1)), turning(0.1 * k)));
    filter.addOdometry(turning(0.1 * k));
    if (k == 120) filter.resample({1, 1, 1, 1, 1});  // dead reckoning knows of no particles
  }
  EXPECT_EQ(filter.snapshot().estimate().dead_reckoning, expected);
  for (const Pose2& pose : filter.snapshot().particles()) EXPECT_NE(pose.x_m, expected.x_m);
}

TEST(ParticleFilter, WithoutNoiseEveryParticleIsDeadReckoning) {
  ParticleFilter filter(quietParams());
  sail(filter, turning, 0, 60);
  for (const Pose2& pose : filter.snapshot().particles())
    EXPECT_EQ(pose, filter.snapshot().estimate().dead_reckoning);
}

TEST(ParticleFilter, RefusesOdometryThatIsNotLaterThanTheOneBefore) {
  ParticleFilter filter(quietParams());
  filter.addOdometry(turning(1.0));
  EXPECT_THROW(filter.addOdometry(turning(1.0)), std::invalid_argument);
  EXPECT_THROW(filter.addOdometry(turning(0.5)), std::invalid_argument);
  EXPECT_EQ(filter.snapshot().counters().odometry_rejected, 2U);
  EXPECT_EQ(filter.snapshot().counters().odometry_messages, 1U);
}

TEST(ParticleFilter, RefusesOdometryWithANumberThatIsNotFinite) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  std::vector<Odometry> bad(10, turning(2.0));
  bad[0].stamp_s = nan;
  bad[1].pose.x_m = nan;
  bad[2].pose.y_m = nan;
  bad[3].pose.yaw_rad = nan;
  bad[4].attitude.z_m = nan;
  bad[5].attitude.roll_rad = nan;
  bad[6].attitude.pitch_rad = nan;
  bad[7].linear_mps.y() = nan;
  bad[8].angular_radps.x() = nan;
  bad[9].linear_mps.z() = std::numeric_limits<double>::infinity();
  for (const Odometry& odometry : bad) {
    ParticleFilter filter(quietParams());
    EXPECT_THROW(filter.addOdometry(odometry), std::invalid_argument);
    EXPECT_TRUE(filter.snapshot().particles().empty());
    filter.addOdometry(turning(1.0));
    EXPECT_THROW(filter.addOdometry(odometry), std::invalid_argument);
    EXPECT_EQ(filter.snapshot().counters().odometry_rejected, 2U);
  }
}

TEST(ParticleFilter, GoesOnAfterRefusedOdometryAsIfItHadNotCome) {
  ParticleFilter clean(noisyParams());
  ParticleFilter disturbed(noisyParams());
  Odometry bad = turning(0.0);
  bad.angular_radps.z() = std::numeric_limits<double>::quiet_NaN();
  for (int k = 0; k < 50; ++k) {
    clean.addOdometry(turning(0.1 * k));
    disturbed.addOdometry(turning(0.1 * k));
    bad.stamp_s = 0.1 * k + 0.05;
    EXPECT_THROW(disturbed.addOdometry(bad), std::invalid_argument);
    EXPECT_THROW(disturbed.addOdometry(turning(0.1 * k - 0.01)), std::invalid_argument);
  }
  EXPECT_EQ(clean.snapshot().particles(), disturbed.snapshot().particles());
}

// ---- the estimate ------------------------------------------------------------------------------

TEST(WeightedMean, WeighsThePoses) {
  const std::vector<Pose2> poses = {{0.0, 10.0, 0.1}, {4.0, 20.0, 0.1}};
  const Pose2 mean = weightedMean(poses, Eigen::Array2d(0.25, 0.75));
  EXPECT_DOUBLE_EQ(mean.x_m, 3.0);
  EXPECT_DOUBLE_EQ(mean.y_m, 17.5);
  EXPECT_NEAR(mean.yaw_rad, 0.1, 1e-15);
}

TEST(WeightedMean, TakesTheYawOnTheCircle) {
  const std::vector<Pose2> poses = {{0.0, 0.0, M_PI - 0.1}, {0.0, 0.0, -M_PI + 0.1}};
  const Eigen::Array2d equal(0.5, 0.5);
  const Pose2 mean = weightedMean(poses, equal);
  EXPECT_NEAR(std::abs(mean.yaw_rad), M_PI, 1e-14);
  EXPECT_NEAR(weightedCovariance(poses, equal, mean)(2, 2), 0.01, 1e-14);
}

TEST(WeightedCovariance, IsThatOfTheWeightedSamples) {
  const std::vector<Pose2> poses = {{1.0, 2.0, 0.1}, {3.0, -1.0, 0.2}, {-2.0, 0.0, -0.1}};
  const Eigen::Array3d weights(0.5, 0.3, 0.2);
  const Pose2 mean = weightedMean(poses, weights);
  Eigen::Matrix3d second = Eigen::Matrix3d::Zero();
  for (int j = 0; j < 3; ++j) {
    const Pose2& pose = poses[static_cast<std::size_t>(j)];
    const Eigen::Vector3d v(pose.x_m, pose.y_m, pose.yaw_rad - mean.yaw_rad);
    second += weights(j) * v * v.transpose();
  }
  const Eigen::Vector3d m(mean.x_m, mean.y_m, 0.0);
  const Eigen::Matrix3d covariance = weightedCovariance(poses, weights, mean);
  // E v v' - m m' equals the centred form but for the yaw, whose mean on the circle is not quite
  // the mean of the angles: by 1e-4 rad here, times deviations of up to 3 m
  EXPECT_LT((covariance - (second - m * m.transpose())).cwiseAbs().maxCoeff(), 1e-3);
}

TEST(ParticleFilter, EstimatesWithTheWeights) {
  ParticleFilter filter(noisyParams(3));
  sail(filter, turning, 0, 10);
  filter.setLogWeights(Eigen::Array3d(0.2, 0.7, 0.1).log());
  const Pose2 expected = weightedMean(filter.snapshot().particles(), Eigen::Array3d(0.2, 0.7, 0.1));
  const Estimate estimate = filter.snapshot().estimate();
  EXPECT_NEAR(estimate.mean.x_m, expected.x_m, 1e-12);
  EXPECT_NEAR(estimate.mean.y_m, expected.y_m, 1e-12);
  EXPECT_NEAR(estimate.mean.yaw_rad, expected.yaw_rad, 1e-12);
  EXPECT_TRUE(estimate.covariance.isApprox(
      weightedCovariance(filter.snapshot().particles(), Eigen::Array3d(0.2, 0.7, 0.1), expected),
      1e-9));
  EXPECT_DOUBLE_EQ(estimate.stamp_s, 0.2 * 49);
  EXPECT_EQ(estimate.attitude.z_m, -10.0);
}

// ---- weights and resampling --------------------------------------------------------------------

TEST(ParticleFilter, RefusesLogWeightsThatAreNotJFiniteNumbers) {
  ParticleFilter filter(quietParams(3));
  const Eigen::ArrayXd before = filter.snapshot().logWeights();
  EXPECT_THROW(filter.setLogWeights(Eigen::ArrayXd::Zero(2)), std::invalid_argument);
  EXPECT_THROW(filter.setLogWeights(Eigen::ArrayXd::Constant(3, std::nan(""))),
               std::invalid_argument);
  EXPECT_TRUE((filter.snapshot().logWeights() == before).all());
  EXPECT_NEAR(before.exp().sum(), 1.0, 1e-15);
}

TEST(ParticleFilter, ResamplesParticlesAndMakesTheWeightsUniform) {
  ParticleFilter filter(noisyParams(4));
  sail(filter, turning, 0, 10);
  filter.setLogWeights(Eigen::Array4d(0.1, 0.2, 0.6, 0.1).log());
  const std::vector<Pose2> before = filter.snapshot().particles();
  filter.resample({2, 1, 2, 2});
  EXPECT_EQ(filter.snapshot().particles(),
            (std::vector<Pose2>{before[2], before[1], before[2], before[2]}));
  EXPECT_TRUE((filter.snapshot().logWeights() - std::log(0.25)).abs().maxCoeff() < 1e-15);
}

TEST(ParticleFilter, LetsTheOffspringOfOneParticlePart) {
  ParticleFilter filter(noisyParams(4));
  sail(filter, turning, 0, 10);
  filter.resample({1, 1, 1, 1});
  sail(filter, turning, 10, 11);
  const std::vector<Pose2> after = filter.snapshot().particles();
  for (std::size_t j = 1; j < 4; ++j) EXPECT_NE(after[j].x_m, after[j - 1].x_m);
}

TEST(ParticleFilter, RefusesMalformedAncestorsAndKeepsItsParticles) {
  ParticleFilter filter(noisyParams(3));
  sail(filter, turning, 0, 10);
  const std::vector<Pose2> before = filter.snapshot().particles();
  EXPECT_THROW(filter.resample({0, 1}), std::invalid_argument);
  EXPECT_THROW(filter.resample({0, 1, 3}), std::invalid_argument);
  EXPECT_EQ(filter.snapshot().particles(), before);
}

TEST(ParticleFilter, HandsOnHistoriesWithTheParticles) {
  ParticleFilter filter(noisyParams(3));
  sail(filter, turning, 0, 20);
  const std::vector<Pose2> at_ping = filter.snapshot().latestPing()->poses;
  filter.resample({2, 2, 0});
  EXPECT_EQ(filter.snapshot().latestPing()->poses,
            (std::vector<Pose2>{at_ping[2], at_ping[2], at_ping[0]}));
}

// ---- seeds -------------------------------------------------------------------------------------

TEST(ParticleFilter, GivesTheSameResultForTheSameSeed) {
  ParticleFilter a(noisyParams(5, 42));
  ParticleFilter b(noisyParams(5, 42));
  for (ParticleFilter* filter : {&a, &b}) {
    sail(*filter, turning, 0, 20);
    filter->resample({1, 1, 2, 4, 4});
    sail(*filter, turning, 20, 30);
  }
  EXPECT_EQ(a.snapshot().particles(), b.snapshot().particles());
  EXPECT_EQ(drawFrom(a, 3, 500), drawFrom(b, 3, 500));
}

TEST(ParticleFilter, GivesAnotherResultForAnotherSeed) {
  ParticleFilter a(noisyParams(5, 1));
  ParticleFilter b(noisyParams(5, 2));
  sail(a, turning, 0, 20);
  sail(b, turning, 0, 20);
  for (std::size_t j = 0; j < 5; ++j)
    EXPECT_NE(a.snapshot().particles()[j].x_m, b.snapshot().particles()[j].x_m);
  FilterParams quiet = quietParams();  // the same poses: only the draws differ
  ParticleFilter c(quiet);
  quiet.seed = 2;
  ParticleFilter d(quiet);
  sail(c, turning, 0, 20);
  sail(d, turning, 0, 20);
  EXPECT_FALSE(drawFrom(c, 0, 100) == drawFrom(d, 0, 100));
}

TEST(ParticleFilter, MovesAParticleAlikeWhateverTheNumberOfOthers) {
  ParticleFilter few(noisyParams(3));
  ParticleFilter many(noisyParams(50));
  sail(few, turning, 0, 20);
  sail(many, turning, 0, 20);
  for (std::size_t j = 0; j < 3; ++j)
    EXPECT_EQ(few.snapshot().particles()[j], many.snapshot().particles()[j]);
}

}  // namespace
}  // namespace rbpf_core
