#include <gtest/gtest.h>

#include <atomic>
#include <future>
#include <numeric>
#include <stdexcept>
#include <thread>
#include <vector>

#include "rbpf_node/turns.hpp"

namespace rbpf_node {
namespace {

rbpf_svgp_slam::MapStatus statusOf(std::uint32_t node, std::uint64_t steps = 0) {
  rbpf_svgp_slam::MapStatus status;
  status.node = node;
  status.steps = steps;
  return status;
}

void nothing(const std::vector<std::uint32_t>&) {}
bool goesOn() { return false; }

using Answer = std::future<std::optional<std::uint32_t>>;

Answer ask(Turns& turns, std::uint32_t node, std::uint64_t steps = 0) {
  return std::async(std::launch::async,
                    [&turns, node, steps] { return turns.take(statusOf(node, steps)); });
}

TEST(Turns, WorkIsDoneByOneSideAtATime) {
  constexpr std::uint32_t kNodes = 3;
  constexpr std::uint32_t kTurns = 200;
  Turns turns(kNodes, goesOn);
  std::atomic<int> working{0};
  std::vector<std::thread> nodes;
  for (std::uint32_t node = 0; node < kNodes; ++node) {
    nodes.emplace_back([&turns, &working, node] {
      std::uint64_t steps = 0;
      while (const auto rounds = turns.take(statusOf(node, steps))) {
        ++working;
        steps += *rounds;
        --working;
      }
    });
  }
  std::uint64_t granted = 0;
  ASSERT_TRUE(turns.awaitAll(nothing));
  for (std::uint32_t turn = 0; turn < kTurns; ++turn) {
    EXPECT_EQ(working, 0);
    turns.grant(turn % 4);
    granted += turn % 4;
    ASSERT_TRUE(turns.awaitAll(nothing));
    const auto states = turns.states();
    ASSERT_EQ(states.size(), kNodes);
    for (std::uint32_t node = 0; node < kNodes; ++node) {
      EXPECT_EQ(states[node].node, node);
      EXPECT_EQ(states[node].steps, granted) << "as it is after this very turn";
    }
  }
  turns.close();
  for (std::thread& node : nodes) node.join();
}

TEST(Turns, WaitsForEveryNodeAndSaysForWhich) {
  Turns turns(3, goesOn);
  Answer first = ask(turns, 1);
  std::vector<std::uint32_t> busy;
  std::vector<Answer> others;
  EXPECT_TRUE(turns.awaitAll([&](const std::vector<std::uint32_t>& nodes) {
    if (busy.empty()) {
      busy = nodes;
      others.push_back(ask(turns, 0));
      others.push_back(ask(turns, 2));
    }
  }));
  EXPECT_EQ(busy, (std::vector<std::uint32_t>{0, 2}));
  turns.grant(7);
  EXPECT_EQ(first.get(), 7U);
  EXPECT_EQ(others[0].get(), 7U);
}

TEST(Turns, AreNotGrantedToANodeAtWork) {
  Turns turns(2, goesOn);
  Answer answer = ask(turns, 0);
  EXPECT_THROW(turns.grant(1), std::logic_error);
  turns.close();
  EXPECT_EQ(answer.get(), std::nullopt);
}

TEST(Turns, ANodeThatAsksOnceMoreGivesUpItsEarlierCall) {
  Turns turns(1, goesOn);
  Answer earlier = ask(turns, 0, 1);
  ASSERT_TRUE(turns.awaitAll(nothing));
  Answer later = ask(turns, 0, 2);
  EXPECT_EQ(earlier.get(), std::nullopt);
  ASSERT_TRUE(turns.awaitAll(nothing));
  EXPECT_EQ(turns.states()[0].steps, 2U);
  turns.grant(3);
  EXPECT_EQ(later.get(), 3U);
}

TEST(Turns, EndForEverybodyWhenAllIsOver) {
  std::atomic<bool> over{false};
  Turns turns(2, [&over] { return over.load(); });
  Answer answer = ask(turns, 0);
  auto replay = std::async(std::launch::async, [&turns] { return turns.awaitAll(nothing); });
  over = true;
  EXPECT_EQ(answer.get(), std::nullopt);
  EXPECT_FALSE(replay.get());
}

TEST(Turns, AreNotForUnknownNodes) {
  Turns turns(2, goesOn);
  EXPECT_THROW(turns.take(statusOf(2)), std::invalid_argument);
}

}  // namespace
}  // namespace rbpf_node
