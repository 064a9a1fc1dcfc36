// Trajectories whose past is corrected: brute force against full copies, and what stays shared.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <vector>

#include "rbpf_core/past_correction.hpp"
#include "rbpf_core/random.hpp"

namespace rbpf_core {
namespace {

// A full copy of every particle's trajectory, in double precision.
class NaiveHistories {
 public:
  explicit NaiveHistories(std::size_t particles) : trajectories_(particles) {}

  std::vector<Pose2> append(RandomStream& stream) {
    std::vector<Pose2> poses;
    for (auto& trajectory : trajectories_) {
      trajectory.push_back({100.0 * stream.uniform(), 100.0 * stream.uniform(),
                            wrapAngle(2.0 * M_PI * stream.uniform())});
      poses.push_back(trajectory.back());
    }
    return poses;
  }

  void resample(const std::vector<std::uint32_t>& ancestors) {
    const auto before = trajectories_;
    for (std::size_t j = 0; j < ancestors.size(); ++j) trajectories_[j] = before[ancestors[j]];
  }

  void correct(const std::vector<Pose2>& of_ping, const Pose2& of_rest) {
    for (auto& trajectory : trajectories_) {
      for (std::size_t i = 0; i < trajectory.size(); ++i) {
        trajectory[i] = move(i < of_ping.size() ? of_ping[i] : of_rest, trajectory[i]);
      }
    }
  }

  const std::vector<std::vector<Pose2>>& trajectories() const { return trajectories_; }

 private:
  std::vector<std::vector<Pose2>> trajectories_;
};

// After up to 30 corrections: x and y are doubles; of the yaw's cosine and sine each correction
// rounds to float32 anew, 3e-8 each time.
void expectEqual(const Trajectories& seen, const NaiveHistories& naive,
                 const std::vector<PoseSlot>& slots) {
  for (std::size_t j = 0; j < seen.particles(); ++j) {
    ASSERT_EQ(slots.size(), naive.trajectories()[j].size());
    for (std::size_t i = 0; i < slots.size(); ++i) {
      const HistoryPose& pose = seen.at(j, slots[i]);
      const Pose2& expected = naive.trajectories()[j][i];
      ASSERT_NEAR(pose.x_m, expected.x_m, 1e-9) << "particle " << j << ", ping " << i;
      ASSERT_NEAR(pose.y_m, expected.y_m, 1e-9) << "particle " << j << ", ping " << i;
      ASSERT_NEAR(pose.cos_yaw, std::cos(expected.yaw_rad), 2e-6);
      ASSERT_NEAR(pose.sin_yaw, std::sin(expected.yaw_rad), 2e-6);
    }
  }
}

Pose2 randomMotion(RandomStream& stream) {
  return {stream.uniform() - 0.5, stream.uniform() - 0.5, 0.1 * (stream.uniform() - 0.5)};
}

std::vector<RigidMotion> bySlot(const std::vector<Pose2>& of_ping,
                                const std::vector<PoseSlot>& slots) {
  std::vector<RigidMotion> motions;
  for (std::size_t i = 0; i < of_ping.size(); ++i) {
    motions.resize(slots[i] + std::size_t{1});
    motions.back() = RigidMotion::of(of_ping[i]);
  }
  return motions;
}

// A survey that is appended to, resampled and corrected at random, also within a correction.
class CorrectedHistories : public testing::TestWithParam<std::size_t> {
 protected:
  void append(std::size_t pings) {
    for (; pings > 0; --pings) slots_.push_back(histories_.append(naive_.append(stream_)));
  }

  void resample() {
    std::vector<std::uint32_t> ancestors;
    for (std::size_t j = 0; j < GetParam(); ++j) {
      ancestors.push_back(static_cast<std::uint32_t>(stream_.below(GetParam())));
    }
    histories_.resample(ancestors);
    naive_.resample(ancestors);
  }

  // Of a random number of the pings, while so many more come in.
  void correct(std::size_t pings_meanwhile) {
    std::vector<Pose2> of_ping;
    for (std::size_t left = stream_.below(slots_.size() + 1); left > 0; --left) {
      of_ping.push_back(randomMotion(stream_));
    }
    const Pose2 of_rest = randomMotion(stream_);
    auto prepared = TrajectoryHistories::prepareCorrection(
        bySlot(of_ping, slots_), RigidMotion::of(of_rest), histories_.state());
    append(pings_meanwhile);
    histories_.commitCorrection(std::move(prepared));
    naive_.correct(of_ping, of_rest);
  }

  RandomStream stream_{GetParam()};
  TrajectoryHistories histories_{GetParam()};
  NaiveHistories naive_{GetParam()};
  std::vector<PoseSlot> slots_;
};

TEST_P(CorrectedHistories, EqualFullCopiesWhateverComesInBetween) {
  for (int i = 0; i < 200; ++i) {
    switch (stream_.below(8)) {
      case 0:
        correct(stream_.below(3));
        break;
      case 1:
      case 2:
        resample();
        break;
      default:
        append(stream_.below(20));
    }
  }
  append(3);
  expectEqual(*histories_.trajectories(), naive_, slots_);
}

TEST_P(CorrectedHistories, BringInAnyNumberOfPingsThatComeMeanwhile) {
  for (const std::size_t pings_meanwhile : {0U, 1U, 27U, 28U, 29U, 200U, 10000U}) {
    append(100);
    correct(pings_meanwhile);
    append(1);
    expectEqual(*histories_.trajectories(), naive_, slots_);
  }
}

TEST_P(CorrectedHistories, StoreAsManyPosesAsBefore) {
  for (int i = 0; i < 20; ++i) {
    append(stream_.below(40));
    resample();
    const std::size_t before = histories_.storedPoses();
    correct(0);
    EXPECT_EQ(histories_.storedPoses(), before);
  }
}

// Of what readers hold nothing moves.
TEST_P(CorrectedHistories, LeaveEarlierTrajectoriesAsTheyWere) {
  append(70);
  resample();
  append(20);
  const auto before = histories_.trajectories();
  const NaiveHistories naive_before = naive_;
  const std::vector<PoseSlot> slots_before = slots_;
  correct(10);
  resample();
  append(500);
  correct(0);
  expectEqual(*before, naive_before, slots_before);
}

TEST_P(CorrectedHistories, MayBeEmpty) {
  correct(0);
  EXPECT_EQ(histories_.storedPoses(), 0U);
  correct(3);
  append(3);
  expectEqual(*histories_.trajectories(), naive_, slots_);
}

INSTANTIATE_TEST_SUITE_P(Particles, CorrectedHistories, testing::Values(1U, 2U, 9U));

// ---- rigid motions -----------------------------------------------------------------------------

TEST(RigidMotion, UndoesWhatItsInverseDoes) {
  const Pose2 a{3.0, -4.0, 2.5};
  const Pose2 b{-1.0, 7.0, 1.4};
  const Pose2 there = compose(a, relative(a, b));
  EXPECT_NEAR(there.x_m, b.x_m, 1e-14);
  EXPECT_NEAR(there.y_m, b.y_m, 1e-14);
  EXPECT_NEAR(there.yaw_rad, b.yaw_rad, 1e-14);
  const HistoryPose moved = move(inverse(a), move(a, HistoryPose::of(b)));
  EXPECT_NEAR(moved.x_m, b.x_m, 1e-14);
  EXPECT_NEAR(moved.y_m, b.y_m, 1e-14);
  EXPECT_NEAR(moved.pose().yaw_rad, b.yaw_rad, 5e-7);  // float32
}

// A quarter turn about the origin, then 10 m along x.
TEST(RigidMotion, TurnsBeforeItShifts) {
  const Pose2 moved = move(Pose2{10.0, 0.0, M_PI / 2}, Pose2{2.0, 1.0, 0.5});
  EXPECT_NEAR(moved.x_m, 9.0, 1e-14);
  EXPECT_NEAR(moved.y_m, 2.0, 1e-14);
  EXPECT_NEAR(moved.yaw_rad, M_PI / 2 + 0.5, 1e-14);
}

}  // namespace
}  // namespace rbpf_core
