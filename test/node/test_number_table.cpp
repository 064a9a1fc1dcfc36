#include <gtest/gtest.h>

#include <cstdio>
#include <cstring>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string>

#include "rbpf_node/number_table.hpp"

namespace rbpf_node {
namespace {

TEST(NumberTable, IsWrittenAsNumpyReadsIt) {
  NumberTable table({"a", "b"});
  table.add({1.0, 2.0});
  table.add({3.0, 4.5});
  const std::string path = testing::TempDir() + "number_table.npy";
  table.write(path);
  std::ifstream file(path, std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(file)), {});
  std::remove(path.c_str());
  ASSERT_EQ(bytes.size() % 64, 4 * sizeof(double));
  EXPECT_EQ(bytes.substr(0, 6), "\x93NUMPY");
  EXPECT_NE(bytes.find("'shape': (2, 2)"), std::string::npos);
  double numbers[4];
  std::memcpy(numbers, bytes.data() + bytes.size() - sizeof(numbers), sizeof(numbers));
  EXPECT_EQ(numbers[0], 1.0);
  EXPECT_EQ(numbers[3], 4.5);
}

TEST(NumberTable, WantsANumberForEachColumn) {
  NumberTable table({"a", "b"});
  EXPECT_THROW(table.add({1.0}), std::logic_error);
  EXPECT_EQ(table.rows(), 0U);
}

TEST(NumberTable, SaysWhichFileCannotBeWritten) {
  try {
    NumberTable({"a"}).write("/nowhere/t.npy");
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_STREQ(error.what(), "/nowhere/t.npy cannot be written");
  }
}

}  // namespace
}  // namespace rbpf_node
