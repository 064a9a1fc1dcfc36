#include "rbpf_core/loop_closing.hpp"

#include <algorithm>
#include <chrono>
#include <exception>
#include <utility>

#include "rbpf_core/random.hpp"

namespace rbpf_core {

namespace {

using Clock = std::chrono::steady_clock;

double secondsSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

}  // namespace

LoopClosing::LoopClosing(ParticleFilter& filter, Maps& maps, LoopClosingParams params)
    : filter_(filter), maps_(maps), params_(std::move(params)) {}

void LoopClosing::resume(std::uint32_t epoch, const LoopClosingState& state) {
  epoch_ = epoch;
  last_prompt_s_ = state.last_prompt_s;
  note([&](auto& statistics) {
    statistics.prompts = state.prompts;
    statistics.prompts_vetoed = state.prompts_vetoed;
    statistics.prompts_skipped = state.prompts_skipped;
    statistics.resamplings_failed = state.resamplings_failed;
    statistics.moved = {state.maps_moved, state.bytes_moved};
  });
}

void LoopClosing::tellObserver() {
  if (observer_ == nullptr) return;
  const LoopClosingStatistics now = statistics();
  observer_->onChange(LoopClosingState{last_prompt_s_, now.prompts, now.prompts_vetoed,
                                       now.prompts_skipped, now.resamplings_failed, now.moved.maps,
                                       now.moved.bytes});
}

// ---- Algorithm 2 ---------------------------------------------------------------------------

StepResult LoopClosing::step() {
  weighFixes();
  // Algorithm 2: prompt, at the rate f_LC, once all maps are ready.
  if (!isDue()) {
    if (!fixes_weighed_ || !whyNotReady().empty()) return {StepOutcome::kNotDue};
    return resampleIfDue({StepOutcome::kNotDue});
  }
  const StepResult prompted = prompt();
  return prompted.outcome == StepOutcome::kPrompted ? resampleIfDue(prompted) : prompted;
}

// Expects a ping.
StepResult LoopClosing::prompt() {
  const PlacedPing ping = filter_.snapshot().latestPing().value();
  last_prompt_s_ = surveySecondsOf(ping.stamp_s);
  tellObserver();  // before it is weighed: whoever resumes would weigh it once more
  if (const std::string why = whyNotReady(); !why.empty()) {
    skip(why);
    return {StepOutcome::kNotReady};
  }
  // Algorithm 2: weights.
  return weigh(ping);
}

AskedPrompt LoopClosing::promptNow() {
  weighFixes();
  const auto nEff = [&] { return effectiveParticles(filter_.snapshot().logWeights().exp()); };
  AskedPrompt asked{StepOutcome::kNotDue};
  asked.n_eff_before = asked.n_eff_weighed = nEff();
  const std::size_t pings = filter_.snapshot().pings();
  if (pings == 0 || last_weighed_ == pings - 1) {
    asked.why =
        pings == 0 ? "no ping has been taken in" : "the latest ping has been weighed already";
    return asked;
  }
  const std::uint32_t prompts_before = statistics().prompts;
  const StepResult prompted = prompt();
  asked.outcome = prompted.outcome;
  asked.has_weighed = statistics().prompts > prompts_before;
  asked.n_eff_weighed = nEff();
  if (!asked.has_weighed) asked.why = statistics().message;
  if (prompted.outcome != StepOutcome::kPrompted) return asked;
  const StepResult resampled = resampleIfDue(prompted);
  asked.outcome = resampled.outcome;
  if (!resampled.problem.empty()) asked.why = resampled.problem;
  return asked;
}

StepResult LoopClosing::resampleIfDue(const StepResult& otherwise) {
  fixes_weighed_ = false;
  // Algorithm 2: the N_eff rule. Asked even if this ping has said nothing: a resampling that was
  // rolled back is still due.
  const Eigen::ArrayXd weights = filter_.snapshot().logWeights().exp();
  if (!params_.resample_when(weights)) return otherwise;

  // Algorithm 2: resampling plan, the ancestor of each particle. One draw for each resampling.
  RandomStream stream = makeStream(filter_.params().seed, StreamPurpose::kResampling, 0, epoch_);
  const auto offspring = systematicOffspring(weights, stream.uniform());
  const auto ancestors = numberOffspring(offspring, maps_.nodeOf());

  // Algorithm 2: resampling, of particles, histories and maps.
  return resample(ancestors);
}

bool LoopClosing::isDue() const {
  const auto stamp_s = filter_.snapshot().latestPingStamp();
  return stamp_s && params_.rate_hz > 0.0 &&
         surveySecondsOf(*stamp_s) - last_prompt_s_ >= 1.0 / params_.rate_hz;
}

double LoopClosing::surveySecondsOf(double stamp_s) const {
  return stamp_s - filter_.snapshot().odometryUse().unsurveyedSeconds(stamp_s);
}

std::string LoopClosing::whyNotReady() const {
  const MapsState maps = maps_.state(epoch_);
  const std::size_t particles = filter_.params().particles;
  if (maps.nodes_heard < maps.nodes) {
    return "waiting for map nodes: " + std::to_string(maps.nodes_heard) + " of " +
           std::to_string(maps.nodes) + " have reported";
  }
  const auto followed = std::count(maps.pasts.begin(), maps.pasts.end(), filter_.snapshot().past());
  if (static_cast<std::size_t>(followed) < maps.nodes) {
    return "maps follow the corrected past: " + std::to_string(followed) + " of " +
           std::to_string(maps.nodes) + " nodes have";
  }
  if (maps.maps_ready < particles) {
    return "maps are training: " + std::to_string(maps.maps_ready) + " of " +
           std::to_string(particles) + " are ready";
  }
  return "";
}

// ---- weights -------------------------------------------------------------------------------

void LoopClosing::weighFixes() {
  const auto fixes = filter_.takeFixesToWeigh();
  // Of several poses that an operator has given meanwhile the last one counts; what else has come
  // is of particles that are no more, and in the smoother's graph.
  const auto given = std::find_if(fixes.rbegin(), fixes.rend(),
                                  [](const auto& one) { return one.fix.heading.has_value(); });
  if (given != fixes.rend()) return filter_.drawAnew(given->fix, given->particles->poses);
  for (const auto& [fix, particles] : fixes) {
    const Eigen::ArrayXd log_likelihood = fixLikelihood(fix, particles->poses);
    filter_.setLogWeights(
        updateWeights(filter_.snapshot().logWeights(), log_likelihood, params_.weighting)
            .log_weights);
    fixes_weighed_ = true;
  }
}

StepResult LoopClosing::weigh(const PlacedPing& ping) {
  const Clock::time_point start = Clock::now();
  try {
    const PingPrediction prediction = maps_.predict(epoch_, ping);
    const Eigen::ArrayXd z_m = ping.levelled_m.row(2).transpose().cast<double>().array();
    PingLikelihood likelihood = pingLikelihood(z_m, prediction, params_.weighting);
    note([&](auto& statistics) { statistics.overlap = likelihood.overlap; });
    if (likelihood.outcome == PromptOutcome::kLittleOverlap) {
      skip("the vehicle is over seabed that is not mapped yet");
    } else if (likelihood.outcome == PromptOutcome::kVetoed) {
      note([&](auto& statistics) {
        ++statistics.prompts_vetoed;
        statistics.message = "vetoed: the best map's innovation is " +
                             std::to_string(likelihood.best_innovation) + " sigma";
      });
    } else {
      if (const double beams = params_.weighting.elbo_beams; beams > 0.0) {
        likelihood.log_likelihood += elboLikelihood(maps_.state(epoch_).elbo, beams);
      }
      const WeightUpdate update = updateWeights(filter_.snapshot().logWeights(),
                                                likelihood.log_likelihood, params_.weighting);
      filter_.setLogWeights(update.log_weights);
      last_weighed_ = ping.index;
      note([&](auto& statistics) {
        ++statistics.prompts;
        statistics.tempering = update.tempering;
        statistics.prompt_s = secondsSince(start);
        statistics.message = "closing loops";
      });
    }
  } catch (const std::exception& error) {
    note([](auto& statistics) { ++statistics.prompts_failed; });
    skip(error.what());
    return {StepOutcome::kFailed, error.what()};
  }
  return {StepOutcome::kPrompted};
}

// ---- resampling in two phases --------------------------------------------------------------

StepResult LoopClosing::resample(const std::vector<std::uint32_t>& ancestors) {
  const Clock::time_point start = Clock::now();
  const std::uint32_t next_epoch = epoch_ + 1;
  resampling_ = true;
  note([](auto& statistics) { statistics.message = "resampling"; });
  MovedMaps moved;
  try {
    moved = maps_.prepare(next_epoch, ancestors);
    filter_.resample(ancestors);
  } catch (const std::exception& error) {
    return rollBack(next_epoch, error.what());
  }
  const StepResult result = commit(next_epoch);
  note([&](auto& statistics) {
    statistics.moved.maps += moved.maps;
    statistics.moved.bytes += moved.bytes;
    statistics.resampling_s = secondsSince(start);
    statistics.message = "closing loops";
  });
  return result;
}

StepResult LoopClosing::commit(std::uint32_t epoch) {
  epoch_ = epoch;  // from here on a node that asks hears: committed
  resampling_ = false;
  try {
    maps_.commit(epoch);
  } catch (const std::exception& error) {
    return {StepOutcome::kResampled, error.what()};
  }
  return {StepOutcome::kResampled};
}

StepResult LoopClosing::rollBack(std::uint32_t epoch, const std::string& why) {
  resampling_ = false;  // from here on a node that asks hears: aborted
  try {
    maps_.abort(epoch);
  } catch (const std::exception&) {
    // nodes that have not been told will ask
  }
  const std::string problem = "resampling rolled back: " + why;
  note([&](auto& statistics) {
    ++statistics.resamplings_failed;
    statistics.message = problem;
  });
  return {StepOutcome::kRolledBack, problem};
}

LoopClosing::Progress LoopClosing::progress() const {
  // in this order: a resampling ends well by raising the epoch first
  const bool resampling = resampling_;
  return {epoch_, resampling};
}

// ---- statistics ----------------------------------------------------------------------------

LoopClosingStatistics LoopClosing::statistics() const {
  const std::lock_guard lock(mutex_);
  return statistics_;
}

template <typename Change>
void LoopClosing::note(const Change& change) {
  const std::lock_guard lock(mutex_);
  change(statistics_);
}

void LoopClosing::skip(const std::string& why) {
  note([&](auto& statistics) {
    ++statistics.prompts_skipped;
    statistics.message = why;
  });
}

}  // namespace rbpf_core
