// A pose that an operator gives: the start, or particles drawn anew.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "fake_maps.hpp"
#include "rbpf_core/loop_closing.hpp"
#include "statistics.hpp"
#include "survey.hpp"

namespace rbpf_core {
namespace {

constexpr std::size_t kDrawnParticles = 4000;

Fix given(double stamp_s, const Pose2& pose) {
  Fix fix{stamp_s, {pose.x_m, pose.y_m}, Eigen::Matrix2d::Zero()};
  fix.covariance_m2 << 4.0, 1.0, 1.0, 1.0;
  fix.heading = Heading{pose.yaw_rad, 0.01};
  return fix;
}

// Mean and covariance of as many particles: four standard errors, which are sqrt(R / J) of the mean
// and at most sqrt(2 / J) R of the covariance.
void expectDrawnAbout(const Pose2& pose, const std::vector<Pose2>& particles) {
  const Eigen::ArrayXd w = Eigen::ArrayXd::Constant(kDrawnParticles, 1.0 / kDrawnParticles);
  const Pose2 mean = weightedMean(particles, w);
  const double errors = 4.0 / std::sqrt(static_cast<double>(kDrawnParticles));
  EXPECT_NEAR(mean.x_m, pose.x_m, 2.0 * errors);
  EXPECT_NEAR(mean.y_m, pose.y_m, errors);
  EXPECT_NEAR(mean.yaw_rad, pose.yaw_rad, 0.1 * errors);
  const Eigen::Matrix3d covariance = weightedCovariance(particles, w, mean);
  EXPECT_NEAR(covariance(0, 0), 4.0, std::sqrt(2.0) * 4.0 * errors);
  EXPECT_NEAR(covariance(0, 1), 1.0, std::sqrt(2.0) * 2.0 * errors);
  EXPECT_NEAR(covariance(1, 1), 1.0, std::sqrt(2.0) * errors);
  EXPECT_NEAR(covariance(2, 2), 0.01, std::sqrt(2.0) * 0.01 * errors);
}

const Pose2 kPose{100.0, -50.0, 2.0};

TEST(GivenPose, IsTheStartBeforeTheFirstPing) {
  ParticleFilter filter(quietParams(kDrawnParticles));
  filter.addFix(given(0.0, kPose));  // before any odometry
  filter.addOdometry(straight(0.0));
  expectDrawnAbout(kPose, filter.snapshot().particles());
  const auto start = filter.snapshot().start().value();
  EXPECT_TRUE(start.pose == kPose);
  EXPECT_NEAR(start.position_std_m, std::sqrt(2.5), 1e-12);  // of 4 and 1 m^2
  EXPECT_NEAR(start.yaw_std_rad, 0.1, 1e-12);

  filter.addOdometry(straight(10.0));
  const Pose2 another{7.0, 8.0, -1.0};
  filter.addFix(given(9.9, another));  // and under way
  expectDrawnAbout(another, filter.snapshot().particles());
  EXPECT_EQ(filter.snapshot().start()->stamp_s, 10.0);
  EXPECT_TRUE(filter.snapshot().estimate().dead_reckoning == another);
  EXPECT_EQ(filter.snapshot().fixes(), 0U);
  EXPECT_EQ(filter.snapshot().redraws(), 0U);
}

class GivenPoseTest : public testing::Test {
 protected:
  GivenPoseTest() {
    for (int s = 0; s <= 10; ++s) filter.addOdometry(straight(s));
    filter.addPing(pingAt(5.0));
  }

  ParticleFilter filter{quietParams(kDrawnParticles)};
  FakeMaps maps{kDrawnParticles};
  LoopClosing closing{filter, maps, {0.0, {}, OnEffectiveSizeDrop{0.0}}};
};

TEST_F(GivenPoseTest, DrawsTheParticlesAnewAsTheyWouldHaveGoneOnFromItsStamp) {
  Eigen::ArrayXd skewed = Eigen::ArrayXd::Zero(kDrawnParticles);
  skewed(0) = 3.0;
  filter.setLogWeights(skewed - std::log(skewed.exp().sum()));
  filter.addFix(given(8.5, kPose));  // 100 m away: it is believed
  EXPECT_EQ(filter.snapshot().fixes(), 1U);
  closing.step();
  EXPECT_EQ(filter.snapshot().redraws(), 1U);
  EXPECT_NEAR(filter.snapshot().logWeights().exp().maxCoeff(), 1.0 / kDrawnParticles, 1e-12);
  // 3 m ahead of where they were drawn, each in its own heading
  std::vector<Pose2> particles = filter.snapshot().particles();
  for (Pose2& pose : particles) {
    pose.x_m -= 3.0 * std::cos(pose.yaw_rad);
    pose.y_m -= 3.0 * std::sin(pose.yaw_rad);
  }
  expectDrawnAbout(kPose, particles);
}

TEST_F(GivenPoseTest, LeavesHistoriesAndDeadReckoningAsTheyAre) {
  const Pose2 before = filter.snapshot().survey(0, 1).at(0).estimate;
  filter.addFix(given(8.5, kPose));
  closing.step();
  EXPECT_TRUE(filter.snapshot().survey(0, 1).at(0).estimate == before);
  EXPECT_NEAR(filter.snapshot().estimate().dead_reckoning.x_m, 20.0, 1e-12);
  filter.addPing(pingAt(9.5));
  EXPECT_GT(std::abs(filter.snapshot().survey(1, 1).at(0).estimate.y_m), 40.0);
}

TEST_F(GivenPoseTest, MakesCorrectionsThatWereUnderWayVoid) {
  filter.addFix(given(8.5, kPose));
  closing.step();
  PastCorrection correction;
  EXPECT_THROW(filter.correctPast(correction), std::invalid_argument);
  correction.redraws = 1;
  EXPECT_NO_THROW(filter.correctPast(correction));
}

// An operator is believed, whatever the estimate says: but not that there is such a place.
TEST_F(GivenPoseTest, IsRefusedBeyondAnyMapOfTheEarth) {
  ParticleFilter fresh(quietParams(kDrawnParticles));
  for (ParticleFilter* of : {&filter, &fresh}) {
    try {
      of->addFix(given(8.5, {100.0, -1e9, 0.0}));
      ADD_FAILURE() << "expected a Refusal";
    } catch (const Refusal& refusal) {
      EXPECT_EQ(refusal.reason(), Reason::kImplausiblePose);
      EXPECT_STREQ(refusal.what(),
                   "fix of stamp 8.500 s lies at (100.0, -1000000000.0) m, expected within "
                   "+-30000000 m. Is it in metres?");
    }
    EXPECT_EQ(of->snapshot().refused().rejected(InputKind::kFix), 1U);
  }
  fresh.addOdometry(straight(0.0));
  EXPECT_EQ(fresh.snapshot().estimate().mean.y_m, 0.0);
  EXPECT_NO_THROW(filter.addFix(given(8.5, {2e7, -2e7, 0.0})));
}

TEST_F(GivenPoseTest, IsRefusedWithoutAVarianceOfItsHeading) {
  Fix fix = given(8.5, kPose);
  fix.heading->variance_rad2 = 0.0;
  try {
    filter.addFix(fix);
    FAIL() << "expected a Refusal";
  } catch (const Refusal& refusal) {
    EXPECT_EQ(refusal.reason(), Reason::kMalformed);
    EXPECT_STREQ(refusal.what(),
                 "fix of stamp 8.500 s has a heading of variance 0.000000 rad^2, expected above 0");
  }
}

}  // namespace
}  // namespace rbpf_core
