#include <gtest/gtest.h>

#include <cmath>

#include "rbpf_node/ping_ages.hpp"

namespace rbpf_node {
namespace {

TEST(PingAges, AreUnknownBeforeTheFirstPing) { EXPECT_TRUE(std::isnan(PingAges().quantile(0.99))); }

TEST(PingAges, TellWhatAShareOfThemDidNotExceed) {
  PingAges ages;
  for (int k = 0; k <= 100; ++k) ages.add((k * 37) % 101);  // 0 .. 100 s, in another order
  EXPECT_EQ(ages.quantile(0.0), 0.0);
  EXPECT_EQ(ages.quantile(0.5), 50.0);
  EXPECT_EQ(ages.quantile(0.99), 99.0);
  EXPECT_EQ(ages.quantile(0.991), 100.0);  // never too small
  EXPECT_EQ(ages.quantile(1.0), 100.0);
  ages.add(7.0);
  EXPECT_EQ(ages.quantile(1.0), 100.0);
}

}  // namespace
}  // namespace rbpf_node
