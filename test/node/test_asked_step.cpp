// A step that one thread asks for and another makes.
#include <gtest/gtest.h>

#include <thread>

#include "rbpf_node/asked_step.hpp"

namespace rbpf_node {
namespace {

constexpr double kPatience_s = 30.0;  // for what must happen; reached only by a bug
bool never() { return false; }

void makeStep(AskedStep* step, const Answer& answer) {
  while (!step->isAsked()) std::this_thread::yield();
  step->answer(answer);
}

TEST(AskedStep, GivesTheAnswerToWhoHasAsked) {
  AskedStep step("the step");
  EXPECT_FALSE(step.isAsked());
  for (const std::string text : {"first", "second"}) {
    std::thread maker(makeStep, &step, Answer{true, text});
    const Answer answer = step.ask(kPatience_s, never);
    maker.join();
    EXPECT_TRUE(answer.success);
    EXPECT_EQ(answer.message, text);
    EXPECT_FALSE(step.isAsked());
  }
}

TEST(AskedStep, RefusesASecondCallMeanwhile) {
  AskedStep step("the step");
  Answer first{false, ""};
  std::thread asker([&] { first = step.ask(kPatience_s, never); });
  while (!step.isAsked()) std::this_thread::yield();
  const Answer second = step.ask(kPatience_s, never);
  EXPECT_FALSE(second.success);
  EXPECT_EQ(second.message, "the step has been asked for already, and is not done yet");
  step.answer({true, "done"});
  asker.join();
  EXPECT_EQ(first.message, "done");
}

TEST(AskedStep, WaitsNoLongerThanItIsTold) {
  AskedStep step("the step");
  const Answer answer = step.ask(0.1, never);
  EXPECT_FALSE(answer.success);
  EXPECT_EQ(answer.message, "the step was not done within 0.1 s");
  EXPECT_FALSE(step.ask(kPatience_s, [] { return true; }).success);
  step.answer({true, "too late"});  // for nobody, not for the next
  EXPECT_FALSE(step.ask(0.0, never).success);
}

}  // namespace
}  // namespace rbpf_node
