#include "rbpf_node/loop_closure_loop.hpp"

#include <ros/console.h>

#include <chrono>
#include <cmath>
#include <exception>

#include "rbpf_core/resampling.hpp"
#include "rbpf_node/conversions.hpp"

namespace rbpf_node {

namespace {

using Clock = std::chrono::steady_clock;

double secondsSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

// Positions of a ping's beams as each particle sees them, [J][2 n], relative to the survey origin.
std::vector<std::vector<float>> positionsOf(const rbpf_core::PlacedPing& ping,
                                            const rbpf_core::Origin& origin) {
  std::vector<std::vector<float>> positions;
  for (const rbpf_core::Pose2& pose : ping.poses) {
    const rbpf_core::Beams placed =
        placeBeams(ping.levelled_m, {pose.x_m - origin.x_m, pose.y_m - origin.y_m, pose.yaw_rad});
    positions.emplace_back();
    for (Eigen::Index i = 0; i < placed.cols(); ++i) {
      positions.back().insert(positions.back().end(), {placed(0, i), placed(1, i)});
    }
  }
  return positions;
}

}  // namespace

LoopClosureLoop::LoopClosureLoop(rbpf_core::ParticleFilter& filter, const MapNodes& maps,
                                 const Parameters& params)
    : filter_(filter), maps_(maps), params_(params) {}

LoopClosureStatistics LoopClosureLoop::statistics() const {
  const std::lock_guard lock(mutex_);
  return statistics_;
}

void LoopClosureLoop::say(const std::string& message) {
  const std::lock_guard lock(mutex_);
  statistics_.message = message;
}

void LoopClosureLoop::skip(const std::string& why) {
  const std::lock_guard lock(mutex_);
  ++statistics_.prompts_skipped;
  statistics_.message = why;
}

bool LoopClosureLoop::promptIsDue() const {
  const auto stamp_s = filter_.snapshot().latestPingStamp();
  return stamp_s && params_.loop_closure_rate_hz > 0.0 &&
         *stamp_s - last_prompt_s_ >= 1.0 / params_.loop_closure_rate_hz;
}

void LoopClosureLoop::promptIfDue() {
  if (!promptIsDue()) return;
  const auto ping =
      filter_.snapshot().latestPing();  // all particles' poses: not to be copied at every look
  last_prompt_s_ = ping->stamp_s;
  const MapsState maps = maps_.state(epoch_);
  if (maps.nodes_heard < params_.nodes) {
    return skip("waiting for map nodes: " + std::to_string(maps.nodes_heard) + " of " +
                std::to_string(params_.nodes) + " have reported");
  }
  if (maps.maps_ready < params_.filter.particles) {
    return skip("maps are training: " + std::to_string(maps.maps_ready) + " of " +
                std::to_string(params_.filter.particles) + " are ready");
  }
  try {
    prompt(*ping);
    resampleIfDepleted();
  } catch (const std::exception& error) {
    ROS_ERROR_THROTTLE(10.0, "Loop-closure prompt failed: %s", error.what());
    skip(error.what());
  }
}

void LoopClosureLoop::prompt(const rbpf_core::PlacedPing& ping) {
  using rbpf_core::PromptOutcome;
  const Clock::time_point start = Clock::now();
  const auto prediction = maps_.predict(epoch_, positionsOf(ping, params_.filter.origin));
  const Eigen::ArrayXd z_m = ping.levelled_m.row(2).transpose().cast<double>().array();
  const auto likelihood = rbpf_core::pingLikelihood(z_m, prediction, params_.loop_closure);
  {
    const std::lock_guard lock(mutex_);
    statistics_.overlap = likelihood.overlap;
  }
  if (likelihood.outcome == PromptOutcome::kLittleOverlap) {
    return skip("the vehicle is over seabed that is not mapped yet");
  }
  if (likelihood.outcome == PromptOutcome::kVetoed) {
    const std::lock_guard lock(mutex_);
    ++statistics_.prompts_vetoed;
    statistics_.message = "vetoed: the best map's innovation is " +
                          std::to_string(likelihood.best_innovation) + " sigma";
    return;
  }
  const auto update = rbpf_core::updateWeights(filter_.snapshot().logWeights(),
                                               likelihood.log_likelihood, params_.loop_closure);
  filter_.setLogWeights(update.log_weights);
  const std::lock_guard lock(mutex_);
  ++statistics_.prompts;
  statistics_.tempering = update.tempering;
  statistics_.prompt_s = secondsSince(start);
  statistics_.message = "closing loops";
}

void LoopClosureLoop::resampleIfDepleted() {
  const Eigen::ArrayXd weights = filter_.snapshot().logWeights().exp();
  const double threshold =
      params_.resampling_threshold * static_cast<double>(params_.filter.particles);
  if (rbpf_core::effectiveParticles(weights) >= threshold) return;
  auto stream =
      rbpf_core::makeStream(params_.filter.seed, rbpf_core::StreamPurpose::kResampling, 0, epoch_);
  const auto offspring = rbpf_core::systematicOffspring(weights, stream.uniform());
  resample(rbpf_core::numberOffspring(offspring, maps_.nodeOf()));
}

void LoopClosureLoop::resample(const std::vector<std::uint32_t>& ancestors) {
  const Clock::time_point start = Clock::now();
  const std::uint32_t next_epoch = epoch_ + 1;
  resampling_ = true;
  say("resampling");
  MovedMaps moved;
  try {
    moved = maps_.prepare(next_epoch, ancestors);
  } catch (const std::exception& error) {
    resampling_ = false;  // from here on a node that asks hears: aborted
    maps_.commit(next_epoch, false);
    const std::lock_guard lock(mutex_);
    ++statistics_.resamplings_failed;
    statistics_.message = std::string("resampling rolled back: ") + error.what();
    ROS_ERROR("%s", statistics_.message.c_str());
    return;
  }
  filter_.resample(ancestors);
  epoch_ = next_epoch;  // from here on a node that asks hears: committed
  resampling_ = false;
  const std::string errors = maps_.commit(next_epoch, true);
  if (!errors.empty()) {
    ROS_WARN("Resampling %u is committed, but not everybody was told: %s. They will ask.",
             next_epoch, errors.c_str());
  }
  const std::lock_guard lock(mutex_);
  statistics_.moved.maps += moved.maps;
  statistics_.moved.bytes += moved.bytes;
  statistics_.resampling_s = secondsSince(start);
  statistics_.message = "closing loops";
}

}  // namespace rbpf_node
