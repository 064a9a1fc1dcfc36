#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <set>
#include <stdexcept>
#include <vector>

#include "rbpf_core/random.hpp"
#include "rbpf_core/trajectory_history.hpp"

namespace rbpf_core {
namespace {

// Every pose ever appended has a number of its own, written into x; the brute force keeps a full
// copy of its numbers for each particle.
class NaiveHistories {
 public:
  explicit NaiveHistories(std::size_t particles) : trajectories_(particles) {}

  std::vector<Pose2> append() {
    std::vector<Pose2> poses;
    for (auto& trajectory : trajectories_) {
      trajectory.push_back(next_);
      poses.push_back({static_cast<double>(next_), -static_cast<double>(next_), 0.0});
      ++next_;
    }
    return poses;
  }

  void resample(const std::vector<std::uint32_t>& ancestors) {
    const auto before = trajectories_;
    for (std::size_t j = 0; j < ancestors.size(); ++j) trajectories_[j] = before[ancestors[j]];
  }

  // Poses that at least one particle still has in its trajectory.
  std::size_t distinctPoses() const {
    std::set<std::uint64_t> distinct;
    for (const auto& trajectory : trajectories_)
      distinct.insert(trajectory.begin(), trajectory.end());
    return distinct.size();
  }

  const std::vector<std::vector<std::uint64_t>>& trajectories() const { return trajectories_; }

 private:
  std::vector<std::vector<std::uint64_t>> trajectories_;
  std::uint64_t next_ = 0;
};

// slots: of the pings.
void expectEqual(const TrajectoryHistories& histories, const NaiveHistories& naive,
                 const std::vector<PoseSlot>& slots) {
  for (std::size_t j = 0; j < naive.trajectories().size(); ++j) {
    ASSERT_EQ(slots.size(), naive.trajectories()[j].size());
    for (std::size_t ping = 0; ping < slots.size(); ++ping) {
      const auto number = static_cast<double>(naive.trajectories()[j][ping]);
      ASSERT_EQ(histories.at(j, slots[ping]).x_m, number) << "particle " << j << ", ping " << ping;
      ASSERT_EQ(histories.at(j, slots[ping]).y_m, -number) << "particle " << j << ", ping " << ping;
    }
  }
}

std::vector<std::uint32_t> randomAncestors(std::size_t particles, RandomStream& stream) {
  std::vector<std::uint32_t> ancestors;
  for (std::size_t j = 0; j < particles; ++j) {
    ancestors.push_back(static_cast<std::uint32_t>(stream.below(particles)));
  }
  return ancestors;
}

TEST(TrajectoryHistories, EqualFullCopiesOverRandomAppendsAndResamplings) {
  for (const std::size_t particles : {1U, 2U, 5U, 17U}) {
    RandomStream stream(particles);
    TrajectoryHistories histories(particles);
    NaiveHistories naive(particles);
    std::vector<PoseSlot> slots;
    for (int i = 0; i < 300; ++i) {
      if (stream.below(4) == 0) {  // often twice in a row, without a ping between
        const auto ancestors = randomAncestors(particles, stream);
        histories.resample(ancestors);
        naive.resample(ancestors);
      } else {
        slots.push_back(histories.append(naive.append()));
      }
      ASSERT_EQ(histories.storedPoses(), naive.distinctPoses());
    }
    expectEqual(histories, naive, slots);
  }
}

TEST(TrajectoryHistories, FindEveryPoseAfterAThousandResamplings) {
  constexpr std::size_t kParticles = 10;
  RandomStream stream(1);
  TrajectoryHistories histories(kParticles);
  NaiveHistories naive(kParticles);
  std::vector<PoseSlot> slots;
  for (int i = 0; i < 1000; ++i) {
    for (std::uint64_t left = stream.below(4); left > 0; --left)
      slots.push_back(histories.append(naive.append()));
    const auto ancestors = randomAncestors(kParticles, stream);
    histories.resample(ancestors);
    naive.resample(ancestors);
  }
  slots.push_back(histories.append(naive.append()));
  expectEqual(histories, naive, slots);
  EXPECT_EQ(histories.storedPoses(), naive.distinctPoses());
}

TEST(TrajectoryHistories, ShareTheirPosesInsteadOfCopyingThem) {
  TrajectoryHistories histories(3);
  NaiveHistories naive(3);
  std::vector<PoseSlot> slots;
  for (int ping = 0; ping < 10; ++ping) slots.push_back(histories.append(naive.append()));
  const HistoryPose* before = &histories.at(1, slots[4]);
  histories.resample({1, 1, 1});
  for (std::size_t j = 0; j < 3; ++j) EXPECT_EQ(&histories.at(j, slots[4]), before);
}

TEST(TrajectoryHistories, CountTheParticlesOfTheStartThatTheyDescendFrom) {
  TrajectoryHistories histories(4);
  NaiveHistories naive(4);
  const auto founders = [&] { return histories.state().trajectories->founders(); };
  for (int ping = 0; ping < 100; ++ping) histories.append(naive.append());
  EXPECT_EQ(founders(), 4U);
  histories.resample({0, 0, 2, 3});
  EXPECT_EQ(founders(), 3U);
  for (int ping = 0; ping < 100; ++ping) histories.append(naive.append());
  histories.resample({0, 1, 0, 1});  // two that differ, of one founder
  EXPECT_EQ(founders(), 1U);
}

TEST(TrajectoryHistories, FreeSegmentsThatNoParticlePointsTo) {
  TrajectoryHistories histories(4);
  NaiveHistories naive(4);
  std::vector<PoseSlot> slots;
  for (int ping = 0; ping < 100; ++ping) slots.push_back(histories.append(naive.append()));
  EXPECT_EQ(histories.storedPoses(), 400U);
  histories.resample({2, 2, 2, 2});
  EXPECT_EQ(histories.storedPoses(), 100U);
  for (int ping = 0; ping < 10; ++ping) slots.push_back(histories.append(naive.append()));
  EXPECT_EQ(histories.storedPoses(), 140U);
  histories.resample({0, 0, 1, 1});
  EXPECT_EQ(histories.storedPoses(), 120U);
}

TEST(TrajectoryHistories, StayAsTheyAreWhenResampledToThemselves) {
  TrajectoryHistories histories(3);
  NaiveHistories naive(3);
  std::vector<PoseSlot> slots;
  histories.resample({0, 1, 2});  // before any ping
  for (int i = 0; i < 5; ++i) {
    slots.push_back(histories.append(naive.append()));
    histories.resample({0, 1, 2});
    histories.resample({0, 1, 2});
  }
  expectEqual(histories, naive, slots);
  EXPECT_EQ(histories.storedPoses(), 15U);
}

// What readers rely on while the survey goes on: no pose moves, and trajectories that somebody
// still looks at stay as they were.
TEST(TrajectoryHistories, LeaveEarlierTrajectoriesAsTheyWere) {
  TrajectoryHistories histories(3);
  NaiveHistories naive(3);
  std::vector<PoseSlot> slots;
  for (int ping = 0; ping < 100; ++ping) slots.push_back(histories.append(naive.append()));
  const NaiveHistories naive_before = naive;
  const auto before = histories.trajectories();
  histories.resample({2, 2, 0});
  naive.resample({2, 2, 0});
  for (int ping = 0; ping < 5000; ++ping) slots.push_back(histories.append(naive.append()));
  expectEqual(histories, naive, slots);
  for (std::size_t j = 0; j < 3; ++j) {
    for (std::size_t ping = 0; ping < 100; ++ping) {
      EXPECT_EQ(before->at(j, slots[ping]).x_m,
                static_cast<double>(naive_before.trajectories()[j][ping]));
    }
  }
}

// Poses appended between the two steps of a resampling are the ancestors' too, be they few or more
// segments than there was room for.
TEST(TrajectoryHistories, APreparedResamplingBringsInWhatHasComeSince) {
  for (const int pings_since : {0, 1, 63, 64, 65, 20000}) {
    TrajectoryHistories histories(4);
    NaiveHistories naive(4);
    std::vector<PoseSlot> slots;
    for (int ping = 0; ping < 100; ++ping) slots.push_back(histories.append(naive.append()));
    auto prepared = TrajectoryHistories::prepareResampling({1, 1, 3, 0}, histories.state());
    for (int ping = 0; ping < pings_since; ++ping) {
      slots.push_back(histories.append(naive.append()));
    }
    histories.commitResampling(std::move(prepared));
    naive.resample({1, 1, 3, 0});
    for (int ping = 0; ping < 3; ++ping) slots.push_back(histories.append(naive.append()));
    expectEqual(histories, naive, slots);
    EXPECT_EQ(histories.storedPoses(), naive.distinctPoses());
  }
}

TEST(TrajectoryHistories, RefuseAnythingButOnePoseForEachParticle) {
  TrajectoryHistories histories(3);
  EXPECT_THROW(histories.append(std::vector<Pose2>(2)), std::invalid_argument);
  EXPECT_THROW(histories.append(std::vector<Pose2>(4)), std::invalid_argument);
  EXPECT_EQ(histories.storedPoses(), 0U);
}

TEST(TrajectoryHistories, RefuseMalformedAncestorsAndKeepWhatTheyHave) {
  TrajectoryHistories histories(3);
  NaiveHistories naive(3);
  std::vector<PoseSlot> slots;
  slots.push_back(histories.append(naive.append()));
  EXPECT_THROW(histories.resample({0, 1}), std::invalid_argument);
  EXPECT_THROW(histories.resample({0, 1, 2, 0}), std::invalid_argument);
  EXPECT_THROW(histories.resample({0, 1, 3}), std::invalid_argument);
  EXPECT_THROW(histories.resample({0, static_cast<std::uint32_t>(-1), 1}), std::invalid_argument);
  expectEqual(histories, naive, slots);
}

TEST(HistoryPose, GivesBackTheYawToFloatPrecision) {
  for (double yaw = -3.1; yaw < 3.2; yaw += 0.1) {
    const Pose2 pose = HistoryPose::of({5e6, -5e6, yaw}).pose();
    EXPECT_EQ(pose.x_m, 5e6);
    EXPECT_EQ(pose.y_m, -5e6);
    EXPECT_NEAR(pose.yaw_rad, yaw, 5e-7);  // two float32 spacings at pi: 0.05 mm at 100 m
  }
}

}  // namespace
}  // namespace rbpf_core
