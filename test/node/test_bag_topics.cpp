#include <gtest/gtest.h>

#include "rbpf_node/bag_topics.hpp"

namespace rbpf_node {
namespace {

const std::set<std::string> kTopics{"/odom", "/mbes/pings", "/auv/nav/odom", "scan"};

TEST(BagTopics, AreFoundWithOrWithoutSlashAndNamespace) {
  EXPECT_EQ(topicInBag("/odom", kTopics), "/odom");
  EXPECT_EQ(topicInBag("odom", kTopics), "/odom");
  EXPECT_EQ(topicInBag("mbes/pings", kTopics), "/mbes/pings");
  EXPECT_EQ(topicInBag("/auv/odom", kTopics), "/odom");
  EXPECT_EQ(topicInBag("/nav/odom", kTopics), "/odom");
  EXPECT_EQ(topicInBag("/scan", kTopics), "scan");
}

TEST(BagTopics, TheLongestNameThatFitsCounts) {
  EXPECT_EQ(topicInBag("/auv/nav/odom", kTopics), "/auv/nav/odom");
}

TEST(BagTopics, AreEmptyWhereThereAreNone) {
  for (const char* name : {"/pings", "/mbes", "/", ""}) EXPECT_EQ(topicInBag(name, kTopics), "");
  EXPECT_EQ(topicInBag("/odom", {}), "");
}

}  // namespace
}  // namespace rbpf_node
