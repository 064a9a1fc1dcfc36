#include "rbpf_node/asked_step.hpp"

#include <chrono>

#include "rbpf_core/decimal.hpp"

namespace rbpf_node {

Answer AskedStep::ask(double patience_s, const std::function<bool()>& gives_up) {
  using Clock = std::chrono::steady_clock;
  const auto give_up = Clock::now() + std::chrono::duration<double>(patience_s);
  std::unique_lock lock(mutex_);
  if (asked_) return {false, name_ + " has been asked for already, and is not done yet"};
  asked_ = true;
  while (!answer_ && Clock::now() < give_up && !gives_up()) {
    changed_.wait_for(lock, std::chrono::milliseconds(50), [&] { return answer_.has_value(); });
  }
  asked_ = false;
  const std::optional<Answer> answer = std::exchange(answer_, std::nullopt);
  if (answer) return *answer;
  return {false, name_ + " was not done within " + rbpf_core::decimal(patience_s, 1) + " s"};
}

bool AskedStep::isAsked() const {
  const std::lock_guard lock(mutex_);
  return asked_ && !answer_;
}

void AskedStep::answer(Answer answer) {
  const std::lock_guard lock(mutex_);
  if (!asked_) return;  // nobody waits any longer
  answer_ = std::move(answer);
  changed_.notify_all();
}

}  // namespace rbpf_node
