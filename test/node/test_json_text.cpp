#include <gtest/gtest.h>

#include <limits>

#include "rbpf_node/json_text.hpp"

namespace rbpf_node::json {
namespace {

TEST(JsonText, EscapesWhatNamesInABagMayHold) {
  EXPECT_EQ(text("/odom"), "\"/odom\"");
  EXPECT_EQ(text("a\"b\\c"), R"("a\"b\\c")");
  EXPECT_EQ(text(std::string("\n\0", 2)), R"("\u000a\u0000")");
  EXPECT_EQ(text("\xff"), R"("\u00ff")");
}

TEST(JsonText, HasNoNumberForWhatIsNotFinite) {
  EXPECT_EQ(number(1650000000.25), "1650000000.25");
  EXPECT_EQ(number(std::numeric_limits<double>::quiet_NaN()), "null");
  EXPECT_EQ(number(std::numeric_limits<double>::infinity()), "null");
}

TEST(JsonText, Nests) {
  EXPECT_EQ(object({{"a", numbers({1.0, 2.0})}, {"b", texts({"c"})}, {"d", list({})}}),
            R"({"a": [1, 2], "b": ["c"], "d": []})");
  EXPECT_EQ(boolean(true) + boolean(false), "truefalse");
}

}  // namespace
}  // namespace rbpf_node::json
