#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "rbpf_node/parallel_calls.hpp"

namespace rbpf_node {
namespace {

struct Service {
  struct Response {};
};

TEST(ErrorsOf, IsEmptyWhenAllWentWell) {
  EXPECT_EQ(errorsOf(std::vector<CallAnswer<Service>>()), "");
  EXPECT_EQ(errorsOf(std::vector<CallAnswer<Service>>(3)), "");
}

TEST(ErrorsOf, NamesEveryoneWhoFailed) {
  const std::vector<CallAnswer<Service>> answers = {
      {{}, "svgp_node_0 cannot be reached"}, {{}, ""}, {{}, "svgp_node_2: out of memory"}};
  EXPECT_EQ(errorsOf(answers), "svgp_node_0 cannot be reached; svgp_node_2: out of memory");
}

}  // namespace
}  // namespace rbpf_node
