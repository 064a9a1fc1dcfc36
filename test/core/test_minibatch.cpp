#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <vector>

#include "placed_block.hpp"
#include "rbpf_core/minibatch.hpp"
#include "statistics.hpp"

namespace rbpf_core {
namespace {

// A survey whose pings have `beams_of` beams, each beam at a random place, and the poses of some
// particles after a few resamplings; what it holds in double is the naive truth.
struct Survey {
  Survey(const std::vector<Eigen::Index>& beams_of, std::size_t particles, const Pose2& around)
      : histories(particles), poses(particles) {
    RandomStream stream(17);
    const auto between = [&](double a, double b) { return a + (b - a) * stream.uniform(); };
    for (std::uint32_t ping = 0; ping < beams_of.size(); ++ping) {
      std::vector<Pose2> now;
      for (std::size_t j = 0; j < particles; ++j) {
        now.push_back({around.x_m + between(-500.0, 500.0), around.y_m + between(-500.0, 500.0),
                       between(-M_PI, M_PI)});
        poses[j].push_back(now.back());
      }
      slots.push_back(histories.append(now));
      ping_of_slot[slots.back()] = ping;
      Beams beams(3, beams_of[ping]);
      for (Eigen::Index i = 0; i < beams.cols(); ++i) {
        // z tells the beam's number in the log
        beams.col(i) << static_cast<float>(between(-40.0, 40.0)),
            static_cast<float>(between(-100.0, 100.0)),
            -static_cast<float>(log.size() + static_cast<std::size_t>(i));
      }
      log.append(slots.back(), beams);
      if (ping % 7 == 3) resample(stream);
    }
  }

  void resample(RandomStream& stream) {
    std::vector<std::uint32_t> ancestors;
    for (std::size_t j = 0; j < poses.size(); ++j) {
      ancestors.push_back(static_cast<std::uint32_t>(stream.below(poses.size())));
    }
    histories.resample(ancestors);
    const auto before = poses;
    for (std::size_t j = 0; j < poses.size(); ++j) poses[j] = before[ancestors[j]];
  }

  std::uint32_t pingOf(std::size_t beam) const { return ping_of_slot.at(log[beam].slot); }

  // Relative to the origin, in double throughout.
  Eigen::Vector3d placed(std::size_t particle, std::size_t beam, const Origin& origin) const {
    const LoggedBeam& b = log[beam];
    const Pose2& pose = poses[particle][pingOf(beam)];
    const double c = std::cos(pose.yaw_rad);
    const double s = std::sin(pose.yaw_rad);
    return {pose.x_m - origin.x_m + c * b.x_m - s * b.y_m,
            pose.y_m - origin.y_m + s * b.x_m + c * b.y_m, b.z_m};
  }

  MbesLog log;
  TrajectoryHistories histories;
  std::vector<PoseSlot> slots;  // [pings]
  std::map<PoseSlot, std::uint32_t> ping_of_slot;
  std::vector<std::vector<Pose2>> poses;  // [J][pings]
};

std::vector<PlacedBeam> draw(const Survey& survey, std::size_t particle, std::size_t size,
                             RandomStream stream, const Origin& origin = {}) {
  std::vector<PlacedBeam> batch(size);
  drawMinibatch(survey.log, survey.log.size(), *survey.histories.trajectories(), particle, origin,
                stream, size, batch.data());
  return batch;
}

bool equal(const std::vector<PlacedBeam>& a, const std::vector<PlacedBeam>& b) {
  return a.size() == b.size() &&
         std::memcmp(a.data(), b.data(), a.size() * sizeof(PlacedBeam)) == 0;
}

std::size_t numberOf(const PlacedBeam& beam) { return static_cast<std::size_t>(-beam.z_m); }

const std::vector<Eigen::Index> kUnevenPings = {3,  0, 40, 1,  1,  200, 17, 5,  5, 90, 2,
                                                60, 8, 33, 71, 10, 4,   50, 99, 1, 300};

TEST(DrawMinibatch, PlacesEachBeamAtItsOwnPingsPoseOfThatParticle) {
  const Survey survey(kUnevenPings, 6, {0.0, 0.0, 0.0});
  const Origin origin{30.0, -40.0};
  for (std::size_t j = 0; j < 6; ++j) {
    for (const PlacedBeam& beam : draw(survey, j, 3000, RandomStream(j), origin)) {
      const Eigen::Vector3d expected = survey.placed(j, numberOf(beam), origin);
      // 1e-4 m: float32 up to 700 m from the origin
      ASSERT_NEAR(beam.x_m, expected.x(), 1e-4);
      ASSERT_NEAR(beam.y_m, expected.y(), 1e-4);
      ASSERT_EQ(beam.z_m, expected.z());
    }
  }
}

TEST(DrawMinibatch, KeepsMillimetresFarFromTheMapsOrigin) {
  const Pose2 far{5e6, -5e6, 0.0};
  const Survey survey(kUnevenPings, 3, far);
  const Origin origin{5e6 + 0.123456, -5e6 - 0.654321};
  for (const PlacedBeam& beam : draw(survey, 1, 3000, RandomStream(1), origin)) {
    const Eigen::Vector3d expected = survey.placed(1, numberOf(beam), origin);
    ASSERT_NEAR(beam.x_m, expected.x(), 1e-3);  // float32 without the origin would give 0.5 m
    ASSERT_NEAR(beam.y_m, expected.y(), 1e-3);
  }
}

// Beams, not pings, are drawn uniformly, however uneven the pings are.
TEST(DrawMinibatch, IsUniformOverBeams) {
  const Survey survey(kUnevenPings, 2, {});
  std::vector<std::size_t> counts(survey.log.size(), 0);
  for (std::uint64_t call = 0; call < 200; ++call) {
    const RandomStream stream = makeStream(1, StreamPurpose::kMinibatch, 0, call);
    for (const PlacedBeam& beam : draw(survey, 0, 1000, stream)) ++counts[numberOf(beam)];
  }
  EXPECT_LT(chiSquare(counts), chiSquareLimit(counts.size()));
}

// Two beams of a minibatch come from one ping no more often than chance has it.
TEST(DrawMinibatch, DrawsBeamsIndependentlyNotInRunsOfAPing) {
  constexpr std::size_t kPings = 100;
  const Survey survey(std::vector<Eigen::Index>(kPings, 50), 1, {});
  std::size_t pairs = 0;
  std::size_t same_ping = 0;
  std::vector<std::size_t> pings_in_batch;
  for (std::uint64_t call = 0; call < 100; ++call) {
    const auto batch = draw(survey, 0, 1000, makeStream(1, StreamPurpose::kMinibatch, 0, call));
    std::map<std::uint32_t, int> pings;
    for (std::size_t i = 0; i < batch.size(); ++i) {
      const std::uint32_t ping = survey.pingOf(numberOf(batch[i]));
      ++pings[ping];
      if (i == 0) continue;
      ++pairs;
      same_ping += survey.pingOf(numberOf(batch[i - 1])) == ping ? 1U : 0U;
    }
    // 1,000 draws miss one of 100 pings with probability 100 * 0.99^1000 = 0.4 %
    EXPECT_GE(pings.size(), kPings - 2);
  }
  const double p = 1.0 / kPings;
  const auto n = static_cast<double>(pairs);
  EXPECT_NEAR(static_cast<double>(same_ping) / n, p, kStandardErrors * std::sqrt(p * (1 - p) / n));
}

TEST(DrawMinibatch, IsAFunctionOfItsStreamAlone) {
  const Survey survey(kUnevenPings, 3, {});
  const auto first = draw(survey, 1, 500, RandomStream(9));
  draw(survey, 2, 100, RandomStream(10));
  EXPECT_TRUE(equal(first, draw(survey, 1, 500, RandomStream(9))));
  EXPECT_FALSE(equal(first, draw(survey, 1, 500, RandomStream(10))));
}

TEST(DrawMinibatch, DrawsFromTheFirstBeamsOnly) {
  const Survey survey(kUnevenPings, 1, {});
  std::vector<PlacedBeam> batch(5000);
  std::size_t highest = 0;
  drawMinibatch(survey.log, 100, *survey.histories.trajectories(), 0, {}, RandomStream(1),
                batch.size(), batch.data());
  for (const PlacedBeam& beam : batch) highest = std::max(highest, numberOf(beam));
  EXPECT_EQ(highest, 99U);  // missed by 5,000 draws with probability e^-50
}

TEST(DrawMinibatch, WritesAsManyBeamsAsAskedForAndNoneBeyond) {
  const Survey survey(kUnevenPings, 2, {});
  constexpr PlacedBeam kGuard{-7.0F, -8.0F, 9.0F};
  for (const std::size_t size : {0U, 1U, 7U, 1000U}) {
    constexpr std::size_t kMargin = 64;
    std::vector<PlacedBeam> cells(size + 2 * kMargin, kGuard);
    drawMinibatch(survey.log, survey.log.size(), *survey.histories.trajectories(), 1, {},
                  RandomStream(size), size, cells.data() + kMargin);
    for (std::size_t i = 0; i < cells.size(); ++i) {
      const bool written = cells[i].z_m != kGuard.z_m;  // depths are never positive
      EXPECT_EQ(written, i >= kMargin && i < kMargin + size) << "cell " << i << " of " << size;
    }
  }
}

// ---- blocks ------------------------------------------------------------------------------------

std::vector<PlacedBeam> block(const Survey& survey, std::size_t particle, std::size_t first,
                              std::size_t size, const Origin& origin = {}) {
  // Other particles' poses come first.
  const std::vector<std::uint32_t> particles = {0, static_cast<std::uint32_t>(particle)};
  return placed(
      logBlock(survey.log, first, size, *survey.histories.trajectories(), particles, origin), 1);
}

TEST(LogBlock, PlacesEachBeamAtItsOwnPingsPoseOfThatParticle) {
  const Survey survey(kUnevenPings, 6, {0.0, 0.0, 0.0});
  const Origin origin{30.0, -40.0};
  for (std::size_t j = 0; j < 6; ++j) {
    const auto beams = block(survey, j, 0, survey.log.size(), origin);
    for (std::size_t i = 0; i < beams.size(); ++i) {
      const Eigen::Vector3d expected = survey.placed(j, i, origin);
      // 1e-4 m: float32 up to 700 m from the origin
      ASSERT_NEAR(beams[i].x_m, expected.x(), 1e-4);
      ASSERT_NEAR(beams[i].y_m, expected.y(), 1e-4);
      ASSERT_EQ(beams[i].z_m, expected.z());
    }
  }
}

// However it is cut: within pings, between them, beam by beam, into nothing.
TEST(LogBlock, CutIntoPiecesGivesTheSameLog) {
  const Survey survey(kUnevenPings, 2, {});
  const auto whole = block(survey, 1, 0, survey.log.size());
  for (const std::size_t size : {1U, 3U, 40U, 43U, 128U}) {
    std::vector<PlacedBeam> pieces;
    for (std::size_t first = 0; first < whole.size(); first += size) {
      const auto piece = block(survey, 1, first, std::min(size, whole.size() - first));
      pieces.insert(pieces.end(), piece.begin(), piece.end());
    }
    EXPECT_TRUE(equal(pieces, whole)) << size;
  }
  EXPECT_TRUE(block(survey, 1, whole.size(), 0).empty());
}

// ---- one beam ----------------------------------------------------------------------------------

TEST(Place, TurnsLeftForPositiveYaw) {
  const LoggedBeam ahead{10.0F, 0.0F, -5.0F, 0};
  const PlacedBeam placed =
      place(ahead, HistoryPose::of({100.0, 200.0, M_PI / 2.0}), {100.0, 200.0});
  EXPECT_NEAR(placed.x_m, 0.0F, 1e-5F);  // float32 at 10 m
  EXPECT_NEAR(placed.y_m, 10.0F, 1e-5F);
  EXPECT_EQ(placed.z_m, -5.0F);
}

}  // namespace
}  // namespace rbpf_core
