#include <gtest/gtest.h>

#include <set>
#include <string>

#include "rbpf_node/nearest_name.hpp"

namespace rbpf_node {
namespace {

const std::set<std::string> kNames = {"lc/rate_hz", "lc/timeout_s", "mapping/hold_back_s",
                                      "particles", "resampling/timeout_s"};

TEST(EditDistance, CountsInsertionsDeletionsAndReplacements) {
  EXPECT_EQ(editDistance("", ""), 0U);
  EXPECT_EQ(editDistance("", "abc"), 3U);
  EXPECT_EQ(editDistance("abc", ""), 3U);
  EXPECT_EQ(editDistance("kitten", "sitting"), 3U);
  EXPECT_EQ(editDistance("particels", "particles"), 2U);
  EXPECT_EQ(editDistance("rate", "rate_hz"), 3U);
}

TEST(NearestName, IsTheOneWithTheFewestMistakes) {
  EXPECT_EQ(nearestName("lc/rate_hx", kNames), "lc/rate_hz");
  EXPECT_EQ(nearestName("particels", kNames), "particles");
  EXPECT_EQ(nearestName("lc/timeout", kNames), "lc/timeout_s");
  EXPECT_EQ(nearestName("resampling/timeout", kNames), "resampling/timeout_s");
}

TEST(NearestName, FindsARightNameInAWrongGroup) {
  EXPECT_EQ(nearestName("pings/hold_back_s", kNames), "mapping/hold_back_s");
  EXPECT_EQ(nearestName("rate_hz", kNames), "lc/rate_hz");
}

TEST(NearestName, IsEmptyIfNoneIsAlike) {
  EXPECT_EQ(nearestName("gravity", kNames), "");
  EXPECT_EQ(nearestName("particles", {}), "");
}

}  // namespace
}  // namespace rbpf_node
