#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "rbpf_node/mount_queue.hpp"

namespace rbpf_node {
namespace {

PingInput pingAt(double stamp_s, const std::string& frame) {
  PingInput ping;
  ping.stamp = ros::Time(stamp_s);
  ping.frame = frame;
  return ping;
}

std::vector<double> stampsOf(const std::vector<PingInput>& pings) {
  std::vector<double> stamps_s;
  for (const PingInput& ping : pings) stamps_s.push_back(ping.stamp.toSec());
  return stamps_s;
}

TEST(MountQueue, LetsEachFrameGoOnItsOwnInTheOrderInWhichItsPingsCame) {
  MountQueue queue(10);
  for (const double stamp_s : {1.0, 3.0, 5.0}) EXPECT_FALSE(queue.push(pingAt(stamp_s, "lost")));
  for (const double stamp_s : {4.0, 2.0}) EXPECT_FALSE(queue.push(pingAt(stamp_s, "mbes")));
  EXPECT_EQ(queue.frames(), (std::vector<std::string>{"lost", "mbes"}));
  EXPECT_EQ(stampsOf(queue.take("mbes")), (std::vector<double>{4.0, 2.0}));
  EXPECT_EQ(queue.frames(), (std::vector<std::string>{"lost"}));
  EXPECT_EQ(queue.size(), 3U);
  EXPECT_EQ(stampsOf(queue.take("lost")), (std::vector<double>{1.0, 3.0, 5.0}));
  EXPECT_EQ(queue.size(), 0U);
}

TEST(MountQueue, KnowsTheEarliestStamp) {
  MountQueue queue(10);
  EXPECT_EQ(queue.earliestStamp(), std::nullopt);
  for (const double stamp_s : {4.0, 2.0, 3.0}) queue.push(pingAt(stamp_s, "mbes"));
  EXPECT_EQ(queue.earliestStamp(), 2.0);
}

TEST(MountQueue, HasNothingForAFrameThatNobodyWaitsFor) {
  MountQueue queue(10);
  queue.push(pingAt(1.0, "mbes"));
  EXPECT_TRUE(queue.take("base_link").empty());
  EXPECT_EQ(queue.size(), 1U);
}

TEST(MountQueue, GivesUpTheOneThatHasWaitedLongestOfAllFrames) {
  MountQueue queue(2);
  EXPECT_FALSE(queue.push(pingAt(1.0, "lost")));
  EXPECT_FALSE(queue.push(pingAt(2.0, "mbes")));
  const auto first = queue.push(pingAt(3.0, "mbes"));
  ASSERT_TRUE(first);
  EXPECT_EQ(first->frame, "lost");
  EXPECT_EQ(first->stamp.toSec(), 1.0);
  const auto second = queue.push(pingAt(4.0, "lost"));
  ASSERT_TRUE(second);
  EXPECT_EQ(second->frame, "mbes");
  EXPECT_EQ(queue.size(), 2U);
}

}  // namespace
}  // namespace rbpf_node
