#include <gtest/gtest.h>

#include <vector>

#include "rbpf_core/mbes_log.hpp"

namespace rbpf_core {
namespace {

// Beams that carry their own number in the log, in all three coordinates.
Beams numberedBeams(std::size_t first, Eigen::Index count) {
  Beams beams(3, count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const auto number = static_cast<float>(first + static_cast<std::size_t>(i));
    beams.col(i) << number, -number, 0.5F * number;
  }
  return beams;
}

TEST(MbesLog, IsEmptyAtFirst) { EXPECT_EQ(MbesLog().size(), 0U); }

TEST(MbesLog, KeepsBeamsInArrivalOrderOverManyBlocks) {
  MbesLog log;
  std::vector<std::uint32_t> ping_of_beam;
  // 400 pings of 0 to 1006 beams: 200,000 beams, more than three blocks, few pings end with a block
  for (std::uint32_t ping = 0; ping < 400; ++ping) {
    const Eigen::Index count = (ping * 487) % 1007;
    log.append(ping, numberedBeams(log.size(), count));
    ping_of_beam.insert(ping_of_beam.end(), static_cast<std::size_t>(count), ping);
  }
  ASSERT_EQ(log.size(), ping_of_beam.size());
  ASSERT_GT(log.size(), 3U << 16);
  for (std::size_t i = 0; i < log.size(); ++i) {
    const auto number = static_cast<float>(i);  // exact: below 2^24
    ASSERT_EQ(log[i].x_m, number);
    ASSERT_EQ(log[i].y_m, -number);
    ASSERT_EQ(log[i].z_m, 0.5F * number);
    ASSERT_EQ(log[i].slot, ping_of_beam[i]);
  }
}

TEST(MbesLog, NeverMovesABeam) {
  MbesLog log;
  std::vector<const LoggedBeam*> places;
  for (std::uint32_t ping = 0; ping < 300; ++ping) {
    const std::size_t first = log.size();
    log.append(ping, numberedBeams(first, 700));
    places.push_back(&log[first]);
  }
  for (std::size_t ping = 0; ping < places.size(); ++ping) {
    EXPECT_EQ(&log[ping * 700], places[ping]);
  }
}

TEST(MbesLog, TakesOnePingOfMoreThanABlock) {
  MbesLog log;
  log.append(0, numberedBeams(0, 5));
  log.append(1, numberedBeams(5, 150000));
  log.append(2, numberedBeams(150005, 1));
  ASSERT_EQ(log.size(), 150006U);
  for (std::size_t i = 0; i < log.size(); ++i) ASSERT_EQ(log[i].x_m, static_cast<float>(i));
  EXPECT_EQ(log[4].slot, 0U);
  EXPECT_EQ(log[5].slot, 1U);
  EXPECT_EQ(log[150004].slot, 1U);
  EXPECT_EQ(log[150005].slot, 2U);
}

}  // namespace
}  // namespace rbpf_core
