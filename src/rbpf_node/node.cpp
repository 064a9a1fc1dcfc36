#include "rbpf_node/node.hpp"

#include <sys/resource.h>

#include <algorithm>
#include <random>
#include <utility>

#include "rbpf_core/decimal.hpp"
#include "rbpf_core/resampling.hpp"
#include "rbpf_svgp_slam/Finish.h"

namespace rbpf_node {

namespace {

constexpr double kPromptErrorPeriod_s = 10.0;
// Of who asks for a smoothing: maps may have to follow the last one first.
constexpr double kSmoothingPatience_s = 300.0;

double peakResidentMb() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) * 1024.0 / 1e6;  // Linux counts in KiB
}

// Of a survey, so that map nodes know it from any other. One that is resumed keeps its own. Of a
// bag there is one survey, and its replays are alike.
std::uint64_t drawnToken() {
  std::random_device random;
  return (std::uint64_t{random()} << 32U | random()) | 1U;  // never 0
}

std::uint64_t tokenOf(Input input, const JournalParameters& journal) {
  if (input == Input::kBag) return 0;
  return journal.resume ? rbpf_core::surveyIn(journal.path) : drawnToken();
}

rbpf_core::LoopClosingParams loopClosingParams(const Parameters& params) {
  return {params.loop_closure_rate_hz, params.loop_closure,
          rbpf_core::OnEffectiveSizeDrop{params.resampling_threshold}};
}

}  // namespace

SlamNode::SlamNode(ros::NodeHandle node, ros::NodeHandle private_node, const Parameters& params,
                   Input input, const JournalParameters& journal)
    : params_(params),
      survey_(tokenOf(input, journal)),
      filter_(params.filter),
      maps_(node, params, survey_),
      loop_closing_(filter_, maps_, loopClosingParams(params)),
      input_(input),
      smoothing_(&filter_, params.smoothing, input, [this] { return haveMapsFollowed(); }),
      services_(private_node, survey_, filter_, loop_closing_, smoothing_),
      publishers_(private_node, filter_, params),
      intake_(params, input, transforms_, &filter_),
      diagnostics_(
          node, private_node,
          {params_, input_, intake_, maps_, loop_closing_, journal_, [this] { return status(); }}),
      triggers_(private_node) {
  if (!journal.path.empty()) keepJournal(journal);
  advertiseTriggers();
  // wall time: the rate means what it says when a bag is replayed faster or slower
  overview_timer_ = node.createWallTimer(ros::WallDuration(1.0 / params_.publish_rate_hz),
                                         [this](const ros::WallTimerEvent&) { publishOverview(); });
}

void SlamNode::keepJournal(const JournalParameters& params) {
  journal_.emplace(params, rbpf_core::ProgramSettings{survey_, params.program}, &filter_,
                   &loop_closing_);
  intake_.resume();
}

// ---- input ---------------------------------------------------------------------------------

void SlamNode::handle(const OdometryInput& input, double receipt_s) {
  intake_.take(input, receipt_s);
  publishers_.publishPose(input.stamp, input.frame);
}

void SlamNode::handle(PingInput input, double receipt_s) {
  const ros::Time stamp = input.stamp;
  intake_.take(std::move(input), receipt_s);
  publishers_.publishPing(stamp);
}

void SlamNode::handle(const FixInput& input, double receipt_s) { intake_.take(input, receipt_s); }

void SlamNode::finish() {
  intake_.finish();
  diagnostics_.expectNoMoreInput();
  smoothing_.finish();
  if (input_ == Input::kBag) smoothing_.work();
}

// ---- what may be asked for -----------------------------------------------------------------

// Of a bag nothing but its end: the same replay is to give the same result.
void SlamNode::advertiseTriggers() {
  using rbpf_svgp_slam::Finish;
  triggers_.add<Finish>(
      "finish", [this](const Finish::Request& request) { return finishAndWait(request.survey); });
  if (input_ == Input::kBag) return;
  const auto is_ending = [this] { return ends_ || !ros::ok(); };
  // all that a prompt may wait for, twice: a step may be under way
  const double prompt_patience_s =
      2.0 * (params_.loop_closure_timeout_s + 2.0 * params_.resampling_timeout_s);
  triggers_.add("prompt", [=](auto&) { return asked_prompt_.ask(prompt_patience_s, is_ending); });
  triggers_.add("smooth",
                [=](auto&) { return smoothing_.smoothNow(kSmoothingPatience_s, is_ending); });
  triggers_.add("pause_mapping", [this](auto&) { return pauseMapping(true); });
  triggers_.add("resume_mapping", [this](auto&) { return pauseMapping(false); });
}

// The number is no secret: it keeps a call by mistake from ending the survey.
Answer SlamNode::finishAndWait(std::uint64_t survey) {
  if (survey != survey_) {
    return {false, "survey is " + std::to_string(survey) + ", expected " + std::to_string(survey_) +
                       ", as in ~status: the survey goes on. survey_recorder/save ends it and "
                       "writes its run"};
  }
  finish();
  // Offline there is nobody to wait for: the replay itself sees to the end.
  if (input_ == Input::kLive) smoothing_.awaitLast([this] { return ends_ || !ros::ok(); });
  const rbpf_core::FilterSnapshot filter = filter_.snapshot();
  return {true,
          std::to_string(filter.pings()) + " pings, " + std::to_string(filter.beams()) + " beams"};
}

Answer SlamNode::promptNow() {
  using rbpf_core::StepOutcome;
  const rbpf_core::AskedPrompt asked = loop_closing_.promptNow();
  std::string message;
  if (asked.has_weighed) {
    message = "N_eff was " + rbpf_core::decimal(asked.n_eff_before, 1) + ", is " +
              rbpf_core::decimal(asked.n_eff_weighed, 1) + " of " +
              std::to_string(params_.filter.particles) + " by this ping; ";
    if (asked.outcome == StepOutcome::kResampled) {
      message += asked.why.empty() ? "resampled" : "resampled, but ";
    } else if (asked.outcome == StepOutcome::kPrompted) {
      message +=
          "not resampled: that is for N_eff below " +
          rbpf_core::decimal(
              params_.resampling_threshold * static_cast<double>(params_.filter.particles), 1);
    }
  } else {
    message = "not weighed: ";
  }
  const bool went_well =
      asked.outcome == StepOutcome::kPrompted || asked.outcome == StepOutcome::kResampled;
  return {asked.has_weighed && went_well, message + asked.why};
}

Answer SlamNode::pauseMapping(bool pause) {
  if (filter_.snapshot().finished()) return {false, "the survey is over: pings are not taken in"};
  const bool was_paused = intake_.setPaused(pause);
  const std::string what = pause ? "pings are not taken in" : "pings are taken in";
  return {true, what + (was_paused == pause ? ", as before" : " from now on")};
}

// ---- loop closing --------------------------------------------------------------------------

bool SlamNode::haveMapsFollowed() const {
  const std::vector<std::uint32_t> pasts = maps_.state(loop_closing_.epoch()).pasts;
  const std::uint32_t past = filter_.snapshot().past();
  return std::all_of(pasts.begin(), pasts.end(), [&](std::uint32_t of) { return of == past; });
}

void SlamNode::closeLoops() {
  using rbpf_core::StepOutcome;
  smoothing_.work();
  if (asked_prompt_.isAsked()) asked_prompt_.answer(promptNow());
  const auto [outcome, problem] = loop_closing_.step();
  if (problem.empty()) return;
  if (outcome == StepOutcome::kFailed) {
    ROS_ERROR_THROTTLE(kPromptErrorPeriod_s, "Loop-closure prompt failed: %s", problem.c_str());
  } else if (outcome == StepOutcome::kRolledBack) {
    ROS_ERROR("%s", problem.c_str());
  } else {
    ROS_WARN("Resampling %u is committed, but not everybody was told: %s. They will ask.",
             loop_closing_.epoch(), problem.c_str());
  }
}

// ---- output --------------------------------------------------------------------------------

rbpf_svgp_slam::FilterStatus SlamNode::status() const {
  rbpf_svgp_slam::FilterStatus status;
  const rbpf_core::FilterSnapshot filter = filter_.snapshot();
  const Eigen::ArrayXd weights = filter.logWeights().exp();
  Eigen::Index best = 0;
  weights.maxCoeff(&best);
  status.header.frame_id = params_.frames.map;
  status.survey = survey_;
  status.particles = static_cast<std::uint32_t>(params_.filter.particles);
  status.nodes = static_cast<std::uint32_t>(params_.nodes);
  status.n_eff = rbpf_core::effectiveParticles(weights);
  status.best_particle = static_cast<std::uint32_t>(best);
  status.peak_rss_mb = peakResidentMb();
  tellInput(filter, &status);
  tellLoopClosing(&status);
  status.journal = journal_ ? journal_->problem() : "none";
  if (status.journal.empty()) status.journal = "kept";
  status.resumed = journal_ ? journal_->resumed() : 0;
  return status;
}

void SlamNode::tellInput(const rbpf_core::FilterSnapshot& filter,
                         rbpf_svgp_slam::FilterStatus* status) const {
  status->odometry_messages = filter.counters().odometry_messages;
  status->pings = filter.pings();
  status->fixes = filter.fixes();
  status->beams = filter.beams();
  status->beams_held_out = filter.beamsHeldOut();
  status->beams_rejected = filter.counters().beams_rejected;
  const IntakeState intake = intake_.state();
  status->header.stamp = intake.last_odometry;
  status->pings_waiting = intake.pings_without_mount + filter.pingsWaiting();
  status->pings_dropped = intake.refused.dropped(rbpf_core::InputKind::kPing);
  status->pings_rejected = intake.refused.rejected(rbpf_core::InputKind::kPing);
  status->fixes_refused = intake.refused.rejected(rbpf_core::InputKind::kFix) +
                          intake.refused.dropped(rbpf_core::InputKind::kFix);
  for (const auto& [what, count] : intake.refused.counts()) {
    status->refusal_reasons.push_back(nameOf(what.first, what.second));
    status->refusal_counts.push_back(count.messages);
    status->refusal_examples.push_back(count.example);
  }
  for (const rbpf_core::Finding& finding : intake.findings) {
    status->findings.push_back(finding.name + ": " + finding.text);
  }
  const rbpf_core::OdometryUse& use = filter.odometryUse();
  status->past = filter.past();
  status->founders = static_cast<std::uint32_t>(filter.founders());
  status->velocity_source = use.source() == rbpf_core::MotionSource::kTwist ? "twist" : "pose";
  status->odometry_gaps = use.gaps();
  status->mapping_paused = intake.mapping_paused;
  status->ping_age_p99_s = intake.ping_age_p99_s;
  status->ping_age_max_s = intake.ping_age_max_s;
}

void SlamNode::tellLoopClosing(rbpf_svgp_slam::FilterStatus* status) const {
  const rbpf_core::LoopClosingStatistics closures = loop_closing_.statistics();
  const std::uint32_t epoch = loop_closing_.epoch();
  const rbpf_core::MapsState maps = maps_.state(epoch);
  status->epoch = epoch;
  status->prompts = closures.prompts;
  status->prompts_vetoed = closures.prompts_vetoed;
  status->prompts_skipped = closures.prompts_skipped;
  status->prompts_failed = closures.prompts_failed;
  status->resamplings_failed = closures.resamplings_failed;
  status->maps_moved = closures.moved.maps;
  status->bytes_moved = closures.moved.bytes;
  status->tempering = closures.tempering;
  status->overlap = closures.overlap;
  status->prompt_s = closures.prompt_s;
  status->resampling_s = closures.resampling_s;
  const auto smoothed = smoothing_.result();
  status->closures = static_cast<std::uint32_t>(smoothed->accepted);
  status->closures_refused =
      static_cast<std::uint32_t>(smoothed->closures.size() - smoothed->accepted);
  status->largest_correction_m = smoothed->largest_change_m;
  status->smoothing_s = smoothed->processor_s;
  status->maps_ready = static_cast<std::uint32_t>(maps.maps_ready);
  status->iterations = maps.steps;
  status->message = closures.message;
}

void SlamNode::publishOverview() {
  intake_.retryUnmounted();  // in case a mount has come since the last ping
  const rbpf_svgp_slam::FilterStatus now = status();
  publishers_.publishStatus(now);
  if (now.odometry_messages > 0)
    publishers_.publishOverview(now.header.stamp, *smoothing_.result());
  diagnostics_.update();
}

}  // namespace rbpf_node
