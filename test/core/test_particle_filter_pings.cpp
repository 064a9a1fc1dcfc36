// How the filter matches pings with poses in time, and what becomes of those it cannot match.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "rbpf_core/particle_filter.hpp"
#include "survey.hpp"

namespace rbpf_core {
namespace {

void addOdometry(ParticleFilter& filter, const std::vector<double>& stamps_s) {
  for (const double stamp_s : stamps_s) filter.addOdometry(turning(stamp_s));
}

std::vector<Pose2> latestPoses(const ParticleFilter& filter) {
  return filter.snapshot().latestPing()->poses;
}

// ---- in time -----------------------------------------------------------------------------------

TEST(PingInTime, LiesOnTheWayBetweenTwoMessages) {
  ParticleFilter filter(quietParams());
  filter.addOdometry(straight(0.0));
  filter.addOdometry(straight(1.0));
  EXPECT_EQ(problemWith(filter, pingAt(0.25)), "");
  EXPECT_EQ(filter.snapshot().latestPing()->stamp_s, 0.25);
  for (const Pose2& pose : latestPoses(filter)) EXPECT_NEAR(pose.x_m, 0.5, 1e-6);  // 2 m/s
}

TEST(PingInTime, IsPlacedByEachParticlesOwnPosesBeforeAndAfter) {
  ParticleFilter filter(noisyParams());
  filter.addOdometry(turning(0.0));
  filter.addOdometry(turning(1.0));
  const std::vector<Pose2> before = filter.snapshot().particles();
  filter.addOdometry(turning(2.0));
  const std::vector<Pose2> after = filter.snapshot().particles();
  filter.addPing(pingAt(1.7));
  const std::vector<Pose2> placed = latestPoses(filter);
  for (std::size_t j = 0; j < before.size(); ++j) {
    const Pose2 expected = interpolate(before[j], after[j], 0.7);
    const Pose2& seen = placed[j];
    EXPECT_NEAR(seen.x_m, expected.x_m, 1e-12);
    EXPECT_NEAR(seen.y_m, expected.y_m, 1e-12);
    EXPECT_NEAR(seen.yaw_rad, expected.yaw_rad, 5e-7);  // histories keep cosines as float32
  }
}

TEST(PingInTime, IsLevelledWithTheAttitudeAtItsOwnStamp) {
  ParticleFilter filter(quietParams());
  Odometry odometry = straight(0.0);
  odometry.attitude = {-10.0, 0.1, -0.1};
  filter.addOdometry(odometry);
  odometry = straight(1.0);
  odometry.attitude = {-12.0, 0.3, 0.3};
  filter.addOdometry(odometry);
  const Ping ping = pingAt(0.5);
  filter.addPing(ping);
  const Beams expected = levelBeams(ping.beams_m, {-11.0, 0.2, 0.1});
  EXPECT_TRUE(filter.snapshot().latestPing()->levelled_m.isApprox(expected, 1e-6F));
}

TEST(PingInTime, TakesTheMessagesOwnPoseAtTheSameStamp) {
  ParticleFilter filter(noisyParams());
  addOdometry(filter, {0.0, 1.0});
  const std::vector<Pose2> at_one = filter.snapshot().particles();
  addOdometry(filter, {2.0});
  filter.addPing(pingAt(1.0));
  for (std::size_t j = 0; j < at_one.size(); ++j) {
    EXPECT_EQ(latestPoses(filter)[j].x_m, at_one[j].x_m);
  }
  filter.addPing(pingAt(0.0));  // the first one as well
  EXPECT_NEAR(latestPoses(filter)[0].x_m, 5.0, 1e-12);
}

TEST(PingInTime, WaitsForOdometryAtOrAfterItsStamp) {
  ParticleFilter filter(quietParams());
  EXPECT_EQ(problemWith(filter, pingAt(0.5)), "");  // before any odometry
  addOdometry(filter, {0.0});
  EXPECT_EQ(problemWith(filter, pingAt(1.0)), "");
  EXPECT_EQ(filter.snapshot().pingsWaiting(), 2U);
  EXPECT_EQ(filter.snapshot().pings(), 0U);
  addOdometry(filter, {0.8});
  EXPECT_EQ(filter.snapshot().pingsWaiting(), 1U);
  EXPECT_EQ(filter.snapshot().latestPing()->stamp_s, 0.5);
  addOdometry(filter, {1.0});
  EXPECT_EQ(filter.snapshot().pingsWaiting(), 0U);
  EXPECT_EQ(filter.snapshot().latestPing()->stamp_s, 1.0);
  EXPECT_EQ(filter.snapshot().counters().pings_dropped, 0U);
}

TEST(PingInTime, ThatWaitedEqualsOneThatDidNot) {
  ParticleFilter waiting(noisyParams());
  ParticleFilter prompt(noisyParams());
  addOdometry(waiting, {0.0, 1.0});
  waiting.addPing(pingAt(1.4));
  addOdometry(waiting, {2.0});
  addOdometry(prompt, {0.0, 1.0, 2.0});
  prompt.addPing(pingAt(1.4));
  EXPECT_EQ(latestPoses(waiting), latestPoses(prompt));
}

TEST(PingInTime, WaitsInTheOrderOfTheStamps) {
  ParticleFilter filter(quietParams());
  filter.addOdometry(straight(0.0));
  for (const double stamp_s : {0.7, 0.3, 0.5}) filter.addPing(pingAt(stamp_s));
  filter.addOdometry(straight(1.0));
  const std::vector<SurveyPing> survey = filter.snapshot().survey(0, 10);
  ASSERT_EQ(survey.size(), 3U);
  EXPECT_EQ(survey[0].record.stamp_s, 0.3);
  EXPECT_EQ(survey[1].record.stamp_s, 0.5);
  EXPECT_EQ(survey[2].record.stamp_s, 0.7);
}

TEST(LatestPing, IsTheLastOneTakenInAndItsStampIsToBeHadAlone) {
  ParticleFilter filter(quietParams());
  addOdometry(filter, {0.0, 1.0});
  filter.addPing(pingAt(1.5));  // waits
  EXPECT_FALSE(filter.snapshot().latestPingStamp().has_value());
  filter.addPing(pingAt(0.75));
  EXPECT_EQ(filter.snapshot().latestPingStamp(), 0.75);
  addOdometry(filter, {2.0});
  EXPECT_EQ(filter.snapshot().latestPingStamp(), 1.5);
  filter.addPing(pingAt(1.25));  // late
  EXPECT_EQ(filter.snapshot().latestPingStamp(), 1.25);
  EXPECT_EQ(filter.snapshot().latestPing()->stamp_s, 1.25);
}

// ---- late, early, too many ---------------------------------------------------------------------

TEST(LatePing, OfTheLastMinuteIsPlacedRight) {
  ParticleFilter filter(quietParams());
  for (int k = 0; k <= 160; ++k) filter.addOdometry(straight(0.5 * k));
  EXPECT_EQ(problemWith(filter, pingAt(20.25)), "");
  for (const Pose2& pose : latestPoses(filter)) EXPECT_NEAR(pose.x_m, 40.5, 1e-9);
  EXPECT_EQ(problemWith(filter, pingAt(25.1)), "");
  for (const Pose2& pose : latestPoses(filter)) EXPECT_NEAR(pose.x_m, 50.2, 1e-9);
  EXPECT_EQ(filter.snapshot().counters().pings_dropped, 0U);
}

TEST(LatePing, BeyondThatIsDroppedAndCounted) {
  ParticleFilter filter(quietParams());
  for (int k = 0; k <= 160; ++k) filter.addOdometry(straight(0.5 * k));
  EXPECT_NE(problemWith(filter, pingAt(19.0)).find("19.0"), std::string::npos);
  EXPECT_EQ(filter.snapshot().counters().pings_dropped, 1U);
  EXPECT_EQ(filter.snapshot().pings(), 0U);
}

TEST(LatePing, IsPlacedRightBeyondThatWhereItIsKnownThatItWillCome) {
  ParticleFilter filter(quietParams());
  filter.keepOdometrySince(5.0);
  for (int k = 0; k <= 80; ++k) filter.addOdometry(straight(k));
  filter.addPing(pingAt(5.5));
  EXPECT_NEAR(filter.snapshot().record(0).dead_reckoning.x_m, 11.0, 1e-9);
  EXPECT_THROW(filter.addPing(pingAt(3.5)), Refusal);
  // and no longer than that
  filter.keepOdometrySince(std::nullopt);
  filter.addOdometry(straight(81));
  EXPECT_THROW(filter.addPing(pingAt(7.5)), Refusal);
}

TEST(LatePing, IsNotWaitedForForEver) {
  ParticleFilter filter(quietParams());
  filter.keepOdometrySince(5.0);
  for (int k = 0; k <= 200; ++k) filter.addOdometry(straight(k));
  EXPECT_THROW(filter.addPing(pingAt(5.5)), Refusal);
  EXPECT_NO_THROW(filter.addPing(pingAt(90.0)));
}

TEST(LatePing, IsPlacedByTheAncestorsPosesAfterAResampling) {
  ParticleFilter filter(noisyParams(4));
  addOdometry(filter, {0.0, 1.0});
  const std::vector<Pose2> before = filter.snapshot().particles();
  addOdometry(filter, {2.0});
  const std::vector<Pose2> after = filter.snapshot().particles();
  const std::vector<std::uint32_t> ancestors = {3, 1, 1, 0};
  filter.resample(ancestors);
  filter.addPing(pingAt(1.5));
  for (std::size_t j = 0; j < 4; ++j) {
    const Pose2 expected = interpolate(before[ancestors[j]], after[ancestors[j]], 0.5);
    EXPECT_NEAR(latestPoses(filter)[j].x_m, expected.x_m, 1e-12);
    EXPECT_NEAR(latestPoses(filter)[j].y_m, expected.y_m, 1e-12);
  }
}

TEST(EarlyPing, FromBeforeTheFirstOdometryIsDroppedAndCounted) {
  ParticleFilter filter(quietParams());
  filter.addPing(pingAt(3.0));  // waits: odometry may yet come
  addOdometry(filter, {5.0, 6.0});
  EXPECT_EQ(filter.snapshot().counters().pings_dropped, 1U);
  EXPECT_NE(problemWith(filter, pingAt(4.9)), "");
  EXPECT_EQ(filter.snapshot().counters().pings_dropped, 2U);
  EXPECT_EQ(filter.snapshot().pings(), 0U);
  EXPECT_EQ(filter.snapshot().pingsWaiting(), 0U);
}

TEST(PingQueue, DropsAndCountsTheOldestWhenItOverflows) {
  FilterParams params = quietParams();
  params.ping_queue = 3;
  ParticleFilter filter(params);
  addOdometry(filter, {0.0});
  for (const double stamp_s : {1.0, 2.0, 3.0}) EXPECT_EQ(problemWith(filter, pingAt(stamp_s)), "");
  EXPECT_NE(problemWith(filter, pingAt(4.0)).find("1.0"), std::string::npos);
  EXPECT_NE(problemWith(filter, pingAt(5.0)).find("2.0"), std::string::npos);
  EXPECT_EQ(filter.snapshot().pingsWaiting(), 3U);
  EXPECT_EQ(filter.snapshot().counters().pings_dropped, 2U);
  addOdometry(filter, {10.0});
  EXPECT_EQ(filter.snapshot().pings(), 3U);
  EXPECT_EQ(filter.snapshot().survey(0, 1).front().record.stamp_s, 3.0);
}

// ---- bad pings ---------------------------------------------------------------------------------

TEST(BadPing, WithoutAGoodBeamIsRejectedAndCounted) {
  ParticleFilter filter(quietParams());
  addOdometry(filter, {0.0, 1.0});
  Ping blind = pingAt(0.5);
  blind.beams_m.setConstant(std::numeric_limits<float>::quiet_NaN());
  EXPECT_NE(problemWith(filter, blind), "");
  EXPECT_NE(problemWith(filter, pingAt(0.6, 0)), "");
  EXPECT_EQ(filter.snapshot().counters().pings_rejected, 2U);
  EXPECT_EQ(filter.snapshot().counters().beams_rejected, 8U);
  EXPECT_EQ(filter.snapshot().pings(), 0U);
}

TEST(BadPing, WithoutAFiniteStampIsRejectedAndCounted) {
  ParticleFilter filter(quietParams());
  addOdometry(filter, {0.0, 1.0});
  EXPECT_NE(problemWith(filter, pingAt(std::numeric_limits<double>::quiet_NaN())), "");
  EXPECT_NE(problemWith(filter, pingAt(std::numeric_limits<double>::infinity())), "");
  EXPECT_EQ(filter.snapshot().counters().pings_rejected, 2U);
  EXPECT_EQ(filter.snapshot().pingsWaiting(), 0U);
}

TEST(BadPing, LosesItsBadBeamsOnly) {
  ParticleFilter filter(quietParams());
  addOdometry(filter, {0.0, 1.0});
  Ping ping = pingAt(0.5, 10);
  ping.beams_m(2, 4) = std::numeric_limits<float>::quiet_NaN();
  ping.beams_m(2, 7) = -1e6F;
  EXPECT_EQ(problemWith(filter, ping), "");
  EXPECT_EQ(filter.snapshot().beams(), 8U);
  EXPECT_EQ(filter.snapshot().counters().beams_rejected, 2U);
  EXPECT_EQ(filter.snapshot().latestPing()->levelled_m.cols(), 8);
}

// ---- the end -----------------------------------------------------------------------------------

TEST(Finish, DropsAndCountsThePingsStillWaiting) {
  ParticleFilter filter(quietParams());
  addOdometry(filter, {0.0, 1.0});
  filter.addPing(pingAt(0.5));
  filter.addPing(pingAt(1.5));
  filter.addPing(pingAt(1.6));
  filter.finish();
  EXPECT_EQ(filter.snapshot().pingsWaiting(), 0U);
  EXPECT_EQ(filter.snapshot().pings(), 1U);
  EXPECT_EQ(filter.snapshot().counters().pings_dropped, 2U);
  EXPECT_NE(problemWith(filter, pingAt(2.0)), "");  // nothing will come for it any more
  EXPECT_EQ(filter.snapshot().counters().pings_dropped, 3U);
}

TEST(Finish, HasPingsRefusedUntilTheSurveyGoesOn) {
  ParticleFilter filter(quietParams());
  addOdometry(filter, {0.0, 1.0, 2.0});
  filter.finish();
  EXPECT_TRUE(filter.snapshot().finished());
  EXPECT_EQ(problemWith(filter, pingAt(1.5)), "ping of stamp 1.500 s came after the survey's end");
  EXPECT_EQ(filter.snapshot().pings(), 0U);
  filter.goOn();
  EXPECT_FALSE(filter.snapshot().finished());
  EXPECT_EQ(problemWith(filter, pingAt(1.6)), "");
  EXPECT_EQ(filter.snapshot().pings(), 1U);
}

// ---- the survey as a whole ---------------------------------------------------------------------

TEST(Survey, HoldsEveryPingWithTheWeightedMeanOfItsHistories) {
  ParticleFilter filter(noisyParams(3));
  const Eigen::Array3d weights(0.2, 0.5, 0.3);
  std::vector<std::vector<Pose2>> naive;  // [pings][J]
  for (int k = 1; k <= 30; ++k) {
    filter.addOdometry(turning(k));
    filter.addPing(pingAt(k));
    naive.push_back(latestPoses(filter));
    if (k == 20) {
      filter.resample({2, 2, 1});
      for (auto& poses : naive) poses = {poses[2], poses[2], poses[1]};
    }
  }
  filter.setLogWeights(weights.log());
  const std::vector<SurveyPing> survey = filter.snapshot().survey(0, 100);
  ASSERT_EQ(survey.size(), 30U);
  for (std::size_t i = 0; i < survey.size(); ++i) {
    const Pose2 mean = weightedMean(naive[i], weights);
    EXPECT_NEAR(survey[i].estimate.x_m, mean.x_m, 1e-9);
    EXPECT_NEAR(survey[i].estimate.y_m, mean.y_m, 1e-9);
    EXPECT_NEAR(survey[i].estimate.yaw_rad, mean.yaw_rad, 1e-9);
    const Eigen::Matrix3d covariance = weightedCovariance(naive[i], weights, mean);
    EXPECT_LT((survey[i].covariance - covariance).cwiseAbs().maxCoeff(), 1e-9);
  }
}

TEST(Survey, KeepsTheEstimateOfTheMomentWhenThePingWasTakenIn) {
  ParticleFilter filter(noisyParams(3));
  const Eigen::Array3d weights(0.2, 0.5, 0.3);
  filter.addOdometry(turning(0.0));
  std::vector<std::vector<Pose2>> seen;  // [pings][J]
  for (int k = 1; k <= 3; ++k) {
    filter.addOdometry(turning(k));
    if (k == 2) filter.setLogWeights(weights.log());
    if (k == 3) filter.resample({2, 2, 1});
    filter.addPing(pingAt(k - 0.5));  // between two messages
    seen.push_back(latestPoses(filter));
  }
  filter.setLogWeights(Eigen::Array3d(0.9, 0.05, 0.05).log());  // what comes later changes nothing
  const Eigen::ArrayXd of[3] = {Eigen::Array3d::Constant(1.0 / 3.0), weights,
                                Eigen::Array3d::Constant(1.0 / 3.0)};
  for (std::size_t i = 0; i < seen.size(); ++i) {
    const PingRecord& record = filter.snapshot().record(i);
    const Pose2 mean = weightedMean(seen[i], of[i]);
    EXPECT_NEAR(record.online.x_m, mean.x_m, 1e-12);
    EXPECT_NEAR(record.online.y_m, mean.y_m, 1e-12);
    EXPECT_NEAR(record.online.yaw_rad, mean.yaw_rad, 5e-7);  // histories keep cosines as float32
    const Eigen::Matrix3d covariance = weightedCovariance(seen[i], of[i], mean);
    EXPECT_GT(covariance(0, 0), 1e-5);
    EXPECT_LT((record.online_covariance - covariance).cwiseAbs().maxCoeff(), 1e-6);
  }
}

TEST(Survey, HandsOutItsOwnBeamsForEveryPingHeldOutOrNot) {
  FilterParams params = quietParams();
  params.holdout = 0.3;
  ParticleFilter filter(params);
  for (int k = 0; k < 40; ++k) {
    filter.addOdometry(straight(k));
    filter.addPing(pingAt(k, 3 + k % 4, static_cast<float>(k)));
  }
  const std::vector<SurveyPing> survey = filter.snapshot().survey(0, 100);
  ASSERT_EQ(survey.size(), 40U);
  for (int k = 0; k < 40; ++k) {
    const SurveyPing& ping = survey[static_cast<std::size_t>(k)];
    ASSERT_EQ(ping.levelled_m.cols(), 3 + k % 4);
    EXPECT_TRUE((ping.levelled_m.row(0).array() == static_cast<float>(k)).all());
    EXPECT_NEAR(ping.record.dead_reckoning.x_m, 2.0 * k, 1e-9);
  }
}

TEST(Survey, CanBeReadInPartsAndWithAStride) {
  ParticleFilter filter(quietParams());
  for (int k = 0; k < 20; ++k) {
    filter.addOdometry(straight(k));
    filter.addPing(pingAt(k));
  }
  const auto stampsOf = [](const std::vector<SurveyPing>& survey) {
    std::vector<double> stamps_s;
    for (const SurveyPing& ping : survey) stamps_s.push_back(ping.record.stamp_s);
    return stamps_s;
  };
  EXPECT_EQ(stampsOf(filter.snapshot().survey(5, 3)), (std::vector<double>{5, 6, 7}));
  EXPECT_EQ(stampsOf(filter.snapshot().survey(18, 10)), (std::vector<double>{18, 19}));
  EXPECT_EQ(stampsOf(filter.snapshot().survey(0, 100, 6)), (std::vector<double>{0, 6, 12, 18}));
  EXPECT_TRUE(filter.snapshot().survey(20, 10).empty());
}

}  // namespace
}  // namespace rbpf_core
