// When the past is smoothed: now and then in the background, in an offline replay in between, when
// somebody asks for it, and once more at the survey's end.
#pragma once

#include <atomic>
#include <functional>
#include <future>
#include <memory>
#include <optional>

#include "rbpf_core/smoothing/past_smoothing.hpp"
#include "rbpf_node/asked_step.hpp"
#include "rbpf_node/intake.hpp"

namespace rbpf_node {

class SmoothingWorker {
 public:
  // may_start: asked before a smoothing; not while maps are still following the last correction.
  SmoothingWorker(rbpf_core::ParticleFilter* filter,
                  const rbpf_core::smoothing::PastSmoothingParams& params, Input input,
                  std::function<bool()> may_start);

  // Starts what is due or asked for and makes the corrections that are ready. By one thread, which
  // makes the resamplings too, as often as you like; it waits for nothing, but offline for the
  // smoothing.
  void work();

  // Smooths once, whatever the period, as soon as maps have followed the last correction; waits for
  // what comes of it, for so long at most. By any thread but the one that works.
  Answer smoothNow(double patience_s, const std::function<bool()>& gives_up) {
    return asked_.ask(patience_s, gives_up);
  }

  // The survey is over: the last smoothing is due. Waits for it if another thread works; until
  // gives_up says true.
  void finish() { is_over_ = true; }
  void awaitLast(const std::function<bool()>& gives_up) const;

  std::shared_ptr<const rbpf_core::smoothing::SmoothedPast> result() const {
    return smoothing_.result();
  }

 private:
  using News = rbpf_core::smoothing::PastSmoothing::News;

  bool startIfDue();
  void start();
  void tellFilter();
  Answer whatCameOf(const News& news) const;

  rbpf_core::ParticleFilter& filter_;
  const bool is_on_;
  const Input input_;
  const std::function<bool()> may_start_;
  rbpf_core::smoothing::PastSmoothing smoothing_;
  std::atomic<bool> is_over_{false};
  std::atomic<bool> is_last_done_{false};
  bool is_last_ = false;
  AskedStep asked_{"smoothing"};
  // Of the smoothing that is running: somebody has asked for it; and what was known before it.
  bool answers_ = false;
  std::shared_ptr<const rbpf_core::smoothing::SmoothedPast> before_;
  // After what it works on: its end waits for the thread.
  std::future<News> running_;
};

}  // namespace rbpf_node
