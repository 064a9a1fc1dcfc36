#include "rbpf_node/smoothing_worker.hpp"

#include <ros/console.h>

#include <algorithm>
#include <chrono>
#include <string>
#include <thread>
#include <utility>

#include "rbpf_core/decimal.hpp"

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
  if (!running_.valid() && !startIfDue()) return;
  // from a bag the work is done here, when it is asked for
  if (input_ == Input::kLive && running_.wait_for(seconds(0)) != std::future_status::ready) return;
  tellFilter();
}

bool SmoothingWorker::startIfDue() {
  const bool is_asked = asked_.isAsked();
  if (is_asked && is_last_done_) {
    asked_.answer({false, "the survey is over, and its past has been smoothed for the last time"});
  } else if (is_asked && filter_.snapshot().pings() == 0) {
    asked_.answer({false, "no ping has been taken in"});
  }
  if (is_last_done_ || !(is_on_ || asked_.isAsked())) return false;
  const bool may_start = may_start_();
  // A period begins when maps have followed: in between there is time for prompts.
  if (!may_start) smoothing_.putOff();
  const bool is_wanted = asked_.isAsked() && may_start;
  if (!is_wanted && !(is_on_ && is_over_) && !smoothing_.isDue()) return false;
  start();
  return true;
}

void SmoothingWorker::start() {
  is_last_ = is_on_ && is_over_;
  answers_ = asked_.isAsked();
  before_ = result();
  running_ = std::async(
      input_ == Input::kLive ? std::launch::async : std::launch::deferred,
      [this, is_last = is_last_] { return is_last ? smoothing_.finish() : smoothing_.smooth(); });
}

void SmoothingWorker::tellFilter() {
  try {
    const News news = running_.get();
    if (news.correction) filter_.correctPast(*news.correction);
    if (news.known_error) filter_.setKnownError(*news.known_error);
    if (answers_) asked_.answer(whatCameOf(news));
  } catch (const std::exception& error) {
    if (answers_) asked_.answer({false, error.what()});
    ROS_ERROR("Smoothing failed, the past stays as it is: %s", error.what());
  }
  if (!is_last_) return;
  const auto found = result();
  ROS_INFO(
      "Past smoothed: %zu of %zu closures accepted, %zu absolute fixes, %.1f s of processor in "
      "all.",
      found->accepted, found->closures.size(), found->fixes, found->processor_s);
  is_last_done_ = true;
}

Answer SmoothingWorker::whatCameOf(const News& news) const {
  const auto now = result();
  const auto more = [](std::size_t after, std::size_t before) {
    return std::to_string(after - std::min(after, before));
  };
  std::string message = more(now->closures.size(), before_->closures.size()) + " new closures, " +
                        more(now->accepted, before_->accepted) +
                        " of them accepted; accepted in all: " + std::to_string(now->accepted) +
                        " of " + std::to_string(now->closures.size()) + "; ";
  message += news.correction
                 ? "moved a ping by up to " + rbpf_core::decimal(now->largest_change_m, 2) + " m"
                 : "the past stays where it is";
  return {true, message};
}

void SmoothingWorker::awaitLast(const std::function<bool()>& gives_up) const {
  while (is_on_ && !is_last_done_ && !gives_up()) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
}

}  // namespace rbpf_node
