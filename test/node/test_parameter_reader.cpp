#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "error_of.hpp"
#include "rbpf_node/parameter_reader.hpp"

namespace rbpf_node {
namespace {

using XmlRpc::XmlRpcValue;

XmlRpcValue listOf(const std::vector<XmlRpcValue>& values) {
  XmlRpcValue list;
  list.setSize(static_cast<int>(values.size()));
  for (std::size_t i = 0; i < values.size(); ++i) list[static_cast<int>(i)] = values[i];
  return list;
}

// What a yaml file leaves on the parameter server.
XmlRpcValue tree() {
  XmlRpcValue tree;
  tree["particles"] = 40;
  tree["engine"] = std::string("svgp");
  tree["common"] = true;
  tree["lc"]["rate_hz"] = 0.2;
  tree["lc"]["beams"] = 30;
  tree["start"] = listOf({1, -2.5, 0.25});
  tree["nothing"] = listOf({});
  tree["area"] = listOf({listOf({0, 0.5}), listOf({100, 0}), listOf({100.0, -50})});
  return tree;
}

XmlRpcValue treeWith(const std::string& name, const XmlRpcValue& value) {
  XmlRpcValue changed = tree();
  changed[name] = value;
  return changed;
}

// The error must name the parameter, its value and what was expected.
void expectError(const std::string& error, const std::string& name, const std::string& value,
                 const std::string& expected) {
  EXPECT_TRUE(contains(error, "parameter " + name + " is " + value + ", expected " + expected))
      << "'" << error << "'";
}

// ---- what is right is read ---------------------------------------------------------------------

TEST(ParameterReader, ReadsEveryKind) {
  ParameterReader reader(tree());
  EXPECT_EQ(reader.integer("particles", 1, 100), 40);
  EXPECT_EQ(reader.text("engine"), "svgp");
  EXPECT_EQ(reader.choice("engine", {"svgp", "grid"}), "svgp");
  EXPECT_TRUE(reader.boolean("common"));
  EXPECT_EQ(reader.number("lc/rate_hz", 0.0, 10.0), 0.2);
  EXPECT_EQ(reader.numbers("start"), (std::vector<double>{1.0, -2.5, 0.25}));
  EXPECT_TRUE(reader.numbers("nothing").empty());
  EXPECT_TRUE(reader.points("nothing").empty());
  const std::vector<std::pair<double, double>> area = {{0.0, 0.5}, {100.0, 0.0}, {100.0, -50.0}};
  EXPECT_EQ(reader.points("area"), area);
}

TEST(ParameterReader, TakesANumberWrittenWithoutAPoint) {
  ParameterReader reader(tree());
  EXPECT_EQ(reader.number("lc/beams", 0.0, 100.0), 30.0);
}

TEST(ParameterReader, IncludesBothLimits) {
  ParameterReader reader(tree());
  EXPECT_EQ(reader.integer("particles", 40, 40), 40);
  EXPECT_EQ(reader.number("lc/rate_hz", 0.2, 0.2), 0.2);
}

// ---- what is wrong is named --------------------------------------------------------------------

TEST(ParameterReader, NamesAMissingParameter) {
  ParameterReader reader(tree());
  expectError(errorOf([&] { reader.number("lc/veto", 0.0, 1.0); }), "lc/veto", "missing",
              "config/default.yaml");
  expectError(errorOf([&] { reader.text("map/engine"); }), "map/engine", "missing",
              "config/default.yaml");
  // a group that an overlay has overwritten by a value
  expectError(errorOf([&] { reader.number("particles/count", 0.0, 1.0); }), "particles/count",
              "missing", "config/default.yaml");
}

TEST(ParameterReader, NamesANumberOfTheWrongType) {
  for (const XmlRpcValue& wrong :
       {XmlRpcValue(std::string("fast")), XmlRpcValue(true), listOf({1.0})}) {
    ParameterReader reader(treeWith("rate", wrong));
    const std::string error = errorOf([&] { reader.number("rate", 0.5, 10.0); });
    EXPECT_TRUE(contains(error, "parameter rate is ")) << error;
    EXPECT_TRUE(contains(error, "expected a finite number from 0.5 to 10")) << error;
  }
  ParameterReader reader(treeWith("rate", XmlRpcValue(std::string("fast"))));
  expectError(errorOf([&] { reader.number("rate", 0.5, 10.0); }), "rate", "fast", "a finite");
}

TEST(ParameterReader, NamesANumberThatIsNotFinite) {
  const double infinity = std::numeric_limits<double>::infinity();
  for (const double wrong : {std::nan(""), infinity, -infinity}) {
    ParameterReader reader(treeWith("rate", XmlRpcValue(wrong)));
    const std::string error = errorOf([&] { reader.number("rate", -1e9, 1e9); });
    EXPECT_TRUE(contains(error, "parameter rate is ")) << error;
    EXPECT_TRUE(contains(error, std::isnan(wrong) ? "nan" : "inf")) << error;
    EXPECT_TRUE(contains(error, "expected a finite number")) << error;
  }
}

TEST(ParameterReader, NamesANumberOutOfRange) {
  ParameterReader reader(tree());
  expectError(errorOf([&] { reader.number("lc/rate_hz", 0.5, 10.0); }), "lc/rate_hz", "0.2",
              "a finite number from 0.5 to 10");
  expectError(errorOf([&] { reader.number("lc/rate_hz", 0.0, 0.1); }), "lc/rate_hz", "0.2",
              "a finite number from 0 to 0.1");
}

TEST(ParameterReader, NamesAnIntegerThatIsNoneOrOutOfRange) {
  ParameterReader reader(tree());
  expectError(errorOf([&] { reader.integer("particles", 1, 39); }), "particles", "40",
              "an integer from 1 to 39");
  expectError(errorOf([&] { reader.integer("particles", 41, 50); }), "particles", "40",
              "an integer from 41 to 50");
  expectError(errorOf([&] { reader.integer("lc/rate_hz", 0, 10); }), "lc/rate_hz", "0.2",
              "an integer from 0 to 10");
  expectError(errorOf([&] { reader.integer("engine", 0, 10); }), "engine", "svgp",
              "an integer from 0 to 10");
}

TEST(ParameterReader, NamesATextThatIsNoneOrEmpty) {
  ParameterReader reader(treeWith("frame", XmlRpcValue(std::string())));
  expectError(errorOf([&] { reader.text("frame"); }), "frame", "", "a text that is not empty");
  expectError(errorOf([&] { reader.text("particles"); }), "particles", "40",
              "a text that is not empty");
}

// A number is not taken for a truth value, nor a text for what it spells.
TEST(ParameterReader, NamesATruthValueThatIsNone) {
  ParameterReader reader(treeWith("spelt", XmlRpcValue(std::string("true"))));
  expectError(errorOf([&] { reader.boolean("spelt"); }), "spelt", "true", "true or false");
  expectError(errorOf([&] { reader.boolean("particles"); }), "particles", "40", "true or false");
}

TEST(ParameterReader, NamesAChoiceAndTheChoicesThereAre) {
  ParameterReader reader(tree());
  expectError(errorOf([&] {
                reader.choice("engine", {"grid", "mesh"});
              }),
              "engine", "svgp", "one of grid mesh");
}

TEST(ParameterReader, NamesAListWithSomethingElseInIt) {
  ParameterReader reader(treeWith("start", listOf({1.0, std::string("two"), 3.0})));
  const std::string error = errorOf([&] { reader.numbers("start"); });
  EXPECT_TRUE(contains(error, "parameter start is {1,two,3}, expected finite numbers")) << error;
  expectError(errorOf([&] { reader.numbers("particles"); }), "particles", "40",
              "a list of numbers");
  ParameterReader with_nan(treeWith("start", listOf({1.0, std::nan("")})));
  EXPECT_TRUE(contains(errorOf([&] { with_nan.numbers("start"); }), "expected finite numbers"));
}

TEST(ParameterReader, NamesAPolygonThatIsNone) {
  const std::vector<XmlRpcValue> wrong = {
      listOf({1.0, 2.0}), listOf({listOf({1.0, 2.0, 3.0})}), listOf({listOf({1.0})}),
      listOf({listOf({1.0, std::nan("")})}), listOf({listOf({1.0, std::string("y")})})};
  for (const XmlRpcValue& value : wrong) {
    ParameterReader reader(treeWith("area", value));
    const std::string error = errorOf([&] { reader.points("area"); });
    EXPECT_TRUE(contains(error, "parameter area is {")) << error;
    EXPECT_TRUE(contains(error, "expected pairs [x, y] of finite numbers")) << error;
  }
  ParameterReader reader(tree());
  expectError(errorOf([&] { reader.points("engine"); }), "engine", "svgp", "a list of [x, y]");
}

// ---- names that nobody asked for ---------------------------------------------------------------

void readEverything(ParameterReader& reader) {
  reader.integer("particles", 1, 100);
  reader.text("engine");
  reader.boolean("common");
  reader.number("lc/rate_hz", 0.0, 10.0);
  reader.number("lc/beams", 0.0, 100.0);
  reader.numbers("start");
  reader.numbers("nothing");
  reader.points("area");
}

TEST(RefuseUnknown, AcceptsATreeOfWhichEverythingWasRead) {
  ParameterReader reader(tree());
  readEverything(reader);
  EXPECT_NO_THROW(reader.refuseUnknown({}));
}

TEST(RefuseUnknown, NamesAnUnknownParameterAndItsValue) {
  ParameterReader reader(treeWith("particels", XmlRpcValue(50)));
  readEverything(reader);
  expectError(errorOf([&] { reader.refuseUnknown({}); }), "particels", "50", "no such parameter");
}

TEST(RefuseUnknown, NamesAnUnknownParameterInAGroup) {
  XmlRpcValue with_typo = tree();
  with_typo["lc"]["rate"] = 0.5;
  ParameterReader reader(with_typo);
  readEverything(reader);
  expectError(errorOf([&] { reader.refuseUnknown({}); }), "lc/rate", "0.5", "no such parameter");
}

TEST(RefuseUnknown, LeavesGroupsAloneThatOthersCheck) {
  XmlRpcValue with_group = tree();
  with_group["svgp"]["kernel"] = std::string("matern12");
  with_group["other"]["svgp"] = 1;
  ParameterReader reader(with_group);
  readEverything(reader);
  expectError(errorOf([&] { reader.refuseUnknown({"svgp"}); }), "other/svgp", "1",
              "no such parameter");
  EXPECT_NO_THROW(reader.refuseUnknown({"svgp", "other"}));
}

}  // namespace
}  // namespace rbpf_node
