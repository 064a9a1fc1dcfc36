// A step that a service asks for: handed to the thread that makes all steps, and waited for.
#pragma once

#include <condition_variable>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

namespace rbpf_node {

// As of std_srvs/Trigger.
struct Answer {
  bool success;
  std::string message;
};

class AskedStep {
 public:
  // name: in messages, "smoothing".
  explicit AskedStep(std::string name) : name_(std::move(name)) {}

  // Waits for what comes of the step, for so long at most, or until gives_up says true. One call at
  // a time: another one is refused meanwhile.
  Answer ask(double patience_s, const std::function<bool()>& gives_up);

  // For the thread that makes the steps.
  bool isAsked() const;
  void answer(Answer answer);

 private:
  const std::string name_;
  mutable std::mutex mutex_;  // guards what follows
  std::condition_variable changed_;
  bool asked_ = false;
  std::optional<Answer> answer_;
};

}  // namespace rbpf_node
