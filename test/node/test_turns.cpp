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

using Answer = std::future<std::optional<Turn>>;

Answer ask(Turns& turns, std::uint32_t node, std::uint32_t done = 0, std::uint64_t steps = 0) {
  return std::async(std::launch::async, [&turns, node, done, steps] {
    return turns.take(statusOf(node, steps), done);
  });
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
      std::uint32_t done = 0;
      while (const auto turn = turns.take(statusOf(node, steps), done)) {
        ++working;
        steps += turn->rounds;
        done = turn->number;
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
  EXPECT_EQ(first.get()->rounds, 7U);
  EXPECT_EQ(others[0].get()->rounds, 7U);
}

TEST(Turns, AreNotGrantedToANodeAtWork) {
  Turns turns(2, goesOn);
  Answer answer = ask(turns, 0);
  EXPECT_THROW(turns.grant(1), std::logic_error);
  turns.close();
  EXPECT_FALSE(answer.get());
}

// Whether its first call is still under way, or its answer has been lost.
TEST(Turns, ANodeThatAsksOnceMoreGetsTheSameTurn) {
  Turns turns(1, goesOn);
  Answer cut_off = ask(turns, 0, 0);
  ASSERT_TRUE(turns.awaitAll(nothing));
  Answer again = ask(turns, 0, 0);
  turns.grant(3);
  EXPECT_EQ(cut_off.get()->rounds, 3U);
  EXPECT_EQ(again.get()->rounds, 3U);
  const auto once_more = turns.take(statusOf(0), 0);
  EXPECT_EQ(once_more->number, 1U);
  EXPECT_EQ(once_more->rounds, 3U);
  EXPECT_THROW(turns.grant(1), std::logic_error) << "none of these says that the turn is done";
  Answer next = ask(turns, 0, 1, 3);
  ASSERT_TRUE(turns.awaitAll(nothing));
  EXPECT_EQ(turns.states()[0].steps, 3U);
  turns.grant(0);
  EXPECT_EQ(next.get()->number, 2U);
}

TEST(Turns, EndForEverybodyWhenAllIsOver) {
  std::atomic<bool> over{false};
  Turns turns(2, [&over] { return over.load(); });
  Answer answer = ask(turns, 0);
  auto replay = std::async(std::launch::async, [&turns] { return turns.awaitAll(nothing); });
  over = true;
  EXPECT_FALSE(answer.get());
  EXPECT_FALSE(replay.get());
}

TEST(Turns, AreNotForUnknownNodes) {
  Turns turns(2, goesOn);
  EXPECT_THROW(turns.take(statusOf(2), 0), std::invalid_argument);
}

TEST(Turns, AreNotDoneBeforeTheyAreGranted) {
  Turns turns(1, goesOn);
  EXPECT_THROW(turns.take(statusOf(0), 1), std::invalid_argument);
}

}  // namespace
}  // namespace rbpf_node
