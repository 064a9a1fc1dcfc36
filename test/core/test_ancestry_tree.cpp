// The benchmark's peer must be right, too.
#include <gtest/gtest.h>

#include "../../bench/core/ancestry_tree.hpp"
#include "../../bench/core/synthetic_survey.hpp"
#include "rbpf_core/trajectory_history.hpp"

namespace rbpf_core {
namespace {

TEST(AncestryTree, FindsThePosesThatSegmentsFind) {
  const bench::Size size{20, 1000, 1};
  for (const std::uint32_t resamplings : {0U, 1U, 10U, 300U}) {
    TrajectoryHistories segments(size.particles);
    bench::AncestryTree tree(size.particles);
    std::vector<PoseSlot> slots;
    std::uint32_t resampled = 0;
    bench::makeSurvey(
        size, resamplings,
        [&](const auto& poses, const auto&) {
          slots.push_back(segments.append(poses));
          tree.append(poses);
        },
        [&](const auto& ancestors) {
          segments.resample(ancestors);
          tree.resample(ancestors);
          ++resampled;
        });
    ASSERT_EQ(resampled, resamplings);
    for (std::size_t j = 0; j < size.particles; ++j) {
      for (std::uint32_t ping = 0; ping < size.pings; ++ping) {
        ASSERT_EQ(segments.at(j, slots[ping]).x_m, tree.at(j, ping).x_m);
        ASSERT_EQ(segments.at(j, slots[ping]).y_m, tree.at(j, ping).y_m);
      }
    }
  }
}

}  // namespace
}  // namespace rbpf_core
