#include <gtest/gtest.h>

#include <limits>
#include <stdexcept>

#include "rbpf_core/rigid.hpp"
#include "rbpf_core/smoothing/track.hpp"

namespace rbpf_core::smoothing {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
// Beams are kept in single precision, here of some tens of metres.
constexpr float kRounding_m = 1e-5F;

Beams across(Eigen::Index n, float half_width_m) {
  Beams beams(3, n);
  beams.row(0).setConstant(0.5F);
  beams.row(1).setLinSpaced(n, -half_width_m, half_width_m);
  beams.row(2).setLinSpaced(n, -80.0F, -79.0F);
  return beams;
}

// 1.5 m/s in a wide turn.
Pose2 poseAt(double stamp_s) { return {1.5 * stamp_s, 0.01 * stamp_s * stamp_s, 0.02 * stamp_s}; }

// Pings from `first_s` on, at 2 Hz.
void addPings(Track* track, double first_s, int pings, Eigen::Index beams = 10) {
  for (int i = 0; i < pings; ++i) {
    const double stamp_s = first_s + 0.5 * i;
    track->addPing(stamp_s, poseAt(stamp_s), across(beams, 20.0F));
  }
}

TEST(TrackNodes, AreTheMiddlesOfStretches) {
  Track track(2.0);
  addPings(&track, 100.0, 41);
  ASSERT_EQ(track.nodes().size(), 10U);
  for (std::size_t i = 0; i < 10; ++i) {
    const TrackNode& node = track.nodes()[i];
    EXPECT_EQ(node.stamp_s, 101.0 + 2.0 * static_cast<double>(i));
    EXPECT_EQ(node.dead_reckoning.x_m, poseAt(node.stamp_s).x_m);
    EXPECT_EQ(node.dead_reckoning.yaw_rad, poseAt(node.stamp_s).yaw_rad);
  }
}

TEST(TrackNodes, AreThereWhenTheNextStretchBeginsOrTheSurveyIsOver) {
  Track track(2.0);
  track.addNode(0.0, {});
  EXPECT_EQ(track.nodes().size(), 1U);
  addPings(&track, 0.0, 4);  // until 1.5 s
  EXPECT_EQ(track.nodes().size(), 1U);
  addPings(&track, 2.0, 2);  // until 2.5 s
  ASSERT_EQ(track.nodes().size(), 2U);
  EXPECT_EQ(track.nodes()[1].beams_m.cols(), 40);
  EXPECT_FALSE(track.isFinished());
  track.finish();
  EXPECT_TRUE(track.isFinished());
  ASSERT_EQ(track.nodes().size(), 3U);
  EXPECT_EQ(track.nodes()[2].beams_m.cols(), 20);
}

TEST(TrackNodes, GoOnAfterASurveyThatSeemedOver) {
  Track track(2.0);
  addPings(&track, 0.0, 2);
  track.finish();
  addPings(&track, 1.0, 1);
  EXPECT_FALSE(track.isFinished());
  ASSERT_EQ(track.nodes().size(), 1U) << "the second one is growing";
  EXPECT_EQ(track.nodes()[0].beams_m.cols(), 20);
  track.finish();
  EXPECT_EQ(track.nodes()[1].beams_m.cols(), 10);
}

TEST(TrackNodes, WithoutBeamsMayStandBetweenPings) {
  Track track(2.0);
  addPings(&track, 0.0, 2);
  EXPECT_EQ(track.addNode(0.7, poseAt(0.7)), 1U);
  EXPECT_EQ(track.nodes()[0].beams_m.cols(), 20) << "the stretch before has ended";
  addPings(&track, 1.0, 1);
  track.finish();
  ASSERT_EQ(track.nodes().size(), 3U);
  EXPECT_EQ(track.nodes()[1].beams_m.cols(), 0);
  EXPECT_EQ(track.nodes()[1].half_width_m, 0.0F);
  EXPECT_EQ(track.nodes()[2].beams_m.cols(), 10);
}

TEST(TrackNodes, OfPingsThatComeLateAreNoOlderThanThePlaceOfAFix) {
  Track track(2.0);
  addPings(&track, 4.0, 2);
  track.addNode(5.0, poseAt(5.0));
  addPings(&track, 4.6, 1);
  track.finish();
  EXPECT_EQ(track.nodes()[2].stamp_s, 5.0);
}

TEST(TrackBeams, LieInTheNodesFrameByDeadReckoning) {
  Track track(2.0);
  addPings(&track, 10.0, 4);
  track.finish();
  const TrackNode& node = track.nodes().front();
  ASSERT_EQ(node.beams_m.cols(), 40);
  const Beams own = across(10, 20.0F);
  for (Eigen::Index b = 0; b < 40; ++b) {
    const Pose2 beam{own(0, b % 10), own(1, b % 10), 0.0};
    const Pose2 in_map = compose(poseAt(10.0 + 0.5 * static_cast<double>(b / 10)), beam);
    const Pose2 expected = relative(node.dead_reckoning, in_map);
    EXPECT_NEAR(node.beams_m(0, b), expected.x_m, kRounding_m);
    EXPECT_NEAR(node.beams_m(1, b), expected.y_m, kRounding_m);
    EXPECT_EQ(node.beams_m(2, b), own(2, b % 10));
  }
}

TEST(TrackBeams, AreThinnedEvenlyToTheirCap) {
  Track track(2.0);
  addPings(&track, 0.0, 4, 1000);
  addPings(&track, 2.0, 4, Track::kBeams / 4);
  track.finish();
  const Beams& thinned = track.nodes()[0].beams_m;
  ASSERT_EQ(thinned.cols(), Track::kBeams);
  EXPECT_EQ(track.nodes()[1].beams_m.cols(), Track::kBeams) << "as many as are kept";
  // z runs from -80 to -79 in each ping: all parts of all pings are there.
  const Beams ping = across(1000, 20.0F);
  for (Eigen::Index i = 0; i < Track::kBeams; ++i) {
    EXPECT_EQ(thinned(2, i), ping(2, i * 4000 / Track::kBeams % 1000)) << i;
  }
}

TEST(TrackBeams, HaveNineTenthsWithinTheHalfWidth) {
  Track track(2.0);
  track.addPing(0.0, {}, across(201, 20.0F));
  track.finish();
  EXPECT_NEAR(track.nodes()[0].half_width_m, 18.0F, 0.2F);  // the beams' distance
}

TEST(TrackBeams, MayBeNone) {
  Track track(2.0);
  track.addPing(0.0, {}, Beams(3, 0));
  track.finish();
  EXPECT_EQ(track.nodes()[0].beams_m.cols(), 0);
  EXPECT_EQ(track.nodes()[0].half_width_m, 0.0F);
  EXPECT_EQ(gather(track, {0, 1}, {Pose2{}}, 0).cols(), 0);
}

TEST(TrackStamps, ThatGoBackAreRefusedAndLeaveNothing) {
  Track track(2.0);
  track.addNode(10.0, {});
  EXPECT_THROW(track.addPing(9.9, {}, across(3, 1.0F)), std::invalid_argument);
  EXPECT_THROW(track.addPing(kNaN, {}, across(3, 1.0F)), std::invalid_argument);
  addPings(&track, 10.0, 3);
  EXPECT_THROW(track.addPing(10.9, {}, across(3, 1.0F)), std::invalid_argument);
  EXPECT_THROW(track.addPing(kNaN, {}, across(3, 1.0F)), std::invalid_argument);
  EXPECT_THROW(track.addNode(9.0, {}), std::invalid_argument);
  EXPECT_THROW(track.addNode(kNaN, {}), std::invalid_argument);
  EXPECT_EQ(track.nodes().size(), 1U);
  EXPECT_EQ(track.pings().size(), 3U);
  EXPECT_NO_THROW(track.addPing(11.0, poseAt(11.0), across(10, 20.0F))) << "equal stamps are fine";
  track.finish();
  EXPECT_EQ(track.nodes()[1].beams_m.cols(), 40);
}

TEST(TrackAround, HasWhatLiesWithin) {
  Track track(2.0);
  addPings(&track, 0.0, 84);  // nodes at 1, 3 .. 41 s, whose beams lie within 1 s
  track.finish();
  const auto expectAround = [&](std::size_t k, double half_s, std::size_t first, std::size_t last) {
    const Track::Range range = track.around(k, half_s);
    EXPECT_EQ(range.first, first) << k << ", " << half_s << " s";
    EXPECT_EQ(range.last, last) << k << ", " << half_s << " s";
  };
  expectAround(10, 5.0, 8, 13);
  expectAround(10, 4.9, 9, 12);
  expectAround(10, 0.0, 10, 11);
  expectAround(1, 5.0, 0, 4);
  expectAround(20, 5.0, 18, 21);
}

TEST(TrackAround, DoesNotReachAcrossGaps) {
  Track track(2.0);
  addPings(&track, 0.0, 12);    // nodes at 1, 3, 5 s
  addPings(&track, 100.3, 12);  // at 101.3, 103.3, 105.3 s
  track.finish();
  ASSERT_EQ(track.nodes().size(), 6U);
  EXPECT_EQ(track.nodes()[3].stamp_s, 101.3);
  EXPECT_EQ(track.around(2, 14.0).last, 3U);
  EXPECT_EQ(track.around(3, 14.0).first, 3U);
  EXPECT_EQ(track.around(3, 14.0).last, 6U);
}

TEST(TrackAround, LeavesOutANodeThatIsGrowing) {
  Track track(2.0);
  addPings(&track, 0.0, 9);  // nodes at 1, 3 s
  EXPECT_EQ(track.around(1, 14.0).last, 2U);
  track.finish();
  EXPECT_EQ(track.around(1, 14.0).last, 3U);
}

TEST(Gather, PlacesEachNodesBeamsByItsPose) {
  Track track(2.0);
  addPings(&track, 0.0, 12);
  track.finish();
  // Not those of dead reckoning.
  const std::vector<Pose2> poses{{500.0, -20.0, 3.0}, {503.0, -21.0, -3.1}, {505.0, -20.0, -2.9}};
  const Track::Range range{0, 3};
  const Beams all = gather(track, range, poses, 1);
  ASSERT_EQ(all.cols(), 120);
  for (Eigen::Index b = 0; b < 120; ++b) {
    const auto node = static_cast<std::size_t>(b / 40);
    const auto own = track.nodes()[node].beams_m.col(b % 40);
    const Pose2 expected = relative(poses[1], compose(poses[node], {own(0), own(1), 0.0}));
    EXPECT_NEAR(all(0, b), expected.x_m, kRounding_m);
    EXPECT_NEAR(all(1, b), expected.y_m, kRounding_m);
    EXPECT_EQ(all(2, b), own(2));
  }
  const Beams few = gather(track, range, poses, 1, 3);
  ASSERT_EQ(few.cols(), 3 * 14);  // of 40, every third from the first on
  EXPECT_EQ(few.col(1), all.col(3));
  EXPECT_EQ(few.col(14), all.col(40));
}

}  // namespace
}  // namespace rbpf_core::smoothing
