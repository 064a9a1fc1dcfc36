#include "rbpf_node/smoothing_worker.hpp"

#include <ros/console.h>

#include <chrono>
#include <thread>
#include <utility>

namespace rbpf_node {

SmoothingWorker::SmoothingWorker(rbpf_core::ParticleFilter* filter,
                                 const rbpf_core::smoothing::PastSmoothingParams& params,
                                 Input input, std::function<bool()> may_start)
    : filter_(*filter),
      is_on_(params.period_s > 0.0),
      input_(input),
      may_start_(std::move(may_start)),
      smoothing_(*filter, params) {}

void SmoothingWorker::work() {
  using std::chrono::seconds;
  if (!is_on_ || is_last_done_) return;
  if (!running_.valid()) {
    // A period begins when maps have followed: in between there is time for prompts.
    if (!may_start_()) smoothing_.putOff();
    if (!is_over_ && !smoothing_.isDue()) return;
    start();
  }
  // from a bag the work is done here, when it is asked for
  if (input_ == Input::kLive && running_.wait_for(seconds(0)) != std::future_status::ready) return;
  tellFilter();
}

void SmoothingWorker::start() {
  is_last_ = is_over_;
  running_ = std::async(
      input_ == Input::kLive ? std::launch::async : std::launch::deferred,
      [this, is_last = is_last_] { return is_last ? smoothing_.finish() : smoothing_.smooth(); });
}

void SmoothingWorker::tellFilter() {
  try {
    const News news = running_.get();
    if (news.correction) filter_.correctPast(*news.correction);
    if (news.known_error) filter_.setKnownError(*news.known_error);
  } catch (const std::exception& error) {
    ROS_ERROR("Smoothing failed, the past stays as it is: %s", error.what());
  }
  if (!is_last_) return;
  const auto found = result();
  ROS_INFO(
      "Past smoothed: %zu of %zu closures accepted, %zu absolute fixes, %.1f s of work in all.",
      found->accepted, found->closures.size(), found->fixes, found->seconds);
  is_last_done_ = true;
}

void SmoothingWorker::awaitLast(const std::function<bool()>& gives_up) const {
  while (is_on_ && !is_last_done_ && !gives_up()) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
}

}  // namespace rbpf_node
