#include <gtest/gtest.h>

#include <cmath>

#include "rbpf_node/ping_ages.hpp"

namespace rbpf_node {
namespace {

TEST(PingAges, AreUnknownBeforeTheFirstPing) { EXPECT_TRUE(std::isnan(PingAges().quantile(0.99))); }

// Never too small, and at most the width of a bin, 2 %, too large.
TEST(PingAges, TellWhatAShareOfThemDidNotExceed) {
  for (const double unit_s : {1e-4, 1e-2, 10.0}) {
    PingAges ages;
    for (int k = 0; k < 100; ++k) ages.add(unit_s * (1 + (k * 37) % 100));  // 1 .. 100, mixed
    for (const int percent : {1, 50, 99}) {
      const double exact_s = unit_s * percent;
      EXPECT_GE(ages.quantile(0.01 * percent), 0.999999 * exact_s);  // rounding
      EXPECT_LE(ages.quantile(0.01 * percent), 1.021 * exact_s);
    }
    EXPECT_EQ(ages.quantile(1.0), unit_s * 100);
  }
}

TEST(PingAges, TakeAnythingThatClocksMayTell) {
  PingAges ages;
  ages.add(-0.5);  // a sensor's clock ahead of ours
  EXPECT_EQ(ages.quantile(1.0), -0.5);
  ages.add(1e9);
  EXPECT_EQ(ages.quantile(1.0), 1e9);
  EXPECT_LT(ages.quantile(0.5), 1e-4);
}

}  // namespace
}  // namespace rbpf_node
