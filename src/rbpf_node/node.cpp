#include "rbpf_node/node.hpp"

#include <sys/resource.h>
#include <tf2_eigen/tf2_eigen.h>

#include <utility>

#include "rbpf_core/resampling.hpp"

namespace rbpf_node {

namespace {

constexpr double kWarningPeriod_s = 5.0;
constexpr double kPromptErrorPeriod_s = 10.0;
constexpr double kInputStale_s = 5.0;

double peakResidentMb() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) * 1024.0 / 1e6;  // Linux counts in KiB
}

rbpf_core::LoopClosingParams loopClosingParams(const Parameters& params) {
  return {params.loop_closure_rate_hz, params.loop_closure,
          rbpf_core::OnEffectiveSizeDrop{params.resampling_threshold}};
}

}  // namespace

SlamNode::SlamNode(ros::NodeHandle node, ros::NodeHandle private_node, const Parameters& params,
                   Input input)
    : params_(params),
      input_(input),
      filter_(params.filter),
      maps_(node, params),
      loop_closing_(filter_, maps_, loopClosingParams(params)),
      services_(private_node, filter_, loop_closing_),
      publishers_(private_node, filter_, params),
      diagnostics_(node, private_node, ros::this_node::getName()),
      unmounted_(params.filter.ping_queue) {
  finish_server_ = private_node.advertiseService("finish", &SlamNode::serveFinish, this);
  diagnostics_.setHardwareID("none");
  diagnostics_.add("input", [this](auto& report) { diagnoseInput(report); });
  diagnostics_.add("filter", [this](auto& report) { diagnoseFilter(report); });
  diagnostics_.add("maps", [this](auto& report) { diagnoseMaps(report); });
  // wall time: the rate means what it says when a bag is replayed faster or slower
  overview_timer_ = node.createWallTimer(ros::WallDuration(1.0 / params_.publish_rate_hz),
                                         [this](const ros::WallTimerEvent&) { publishOverview(); });
}

// ---- input ---------------------------------------------------------------------------------

void SlamNode::handle(const OdometryInput& input) {
  const rbpf_core::Odometry odometry = toOdometry(input, params_.frames);
  {
    const std::lock_guard lock(mutex_);
    expectLaterThanLast(input.stamp);
    filter_.addOdometry(odometry);
    notePingsLost(Reason::kNoOdometry, "a ping is older than all odometry",
                  "no beam of a ping is finite and within range");
    if (!last_odometry_.isZero() &&
        (input.stamp - last_odometry_).toSec() > params_.odometry_gap_s) {
      ROS_WARN("Odometry has a gap of %.2f s before %.3f s; bridged with the mean twist.",
               (input.stamp - last_odometry_).toSec(), input.stamp.toSec());
    }
    last_odometry_ = input.stamp;
    notePingAges();
  }
  publishers_.publishPose(input.stamp);
}

void SlamNode::expectLaterThanLast(const ros::Time& stamp) const {
  // as the filter sees them: in seconds of limited resolution
  const double stamp_s = stamp.toSec();
  const double last_s = last_odometry_.toSec();
  if (last_odometry_.isZero() || stamp_s > last_s) return;
  throw Refusal(stamp_s == last_s ? Reason::kDuplicateStamp : Reason::kOutOfOrder,
                "odometry's stamp is " + std::to_string(stamp_s) + " s, expected later than " +
                    std::to_string(last_s) + " s, the last one's");
}

void SlamNode::handle(PingInput input) {
  const ros::Time stamp = input.stamp;
  {
    const std::lock_guard lock(mutex_);
    takeInMounted();  // older ones first
    if (const auto T_base_sensor = mountOf(input.frame)) {
      takeIn(input, *T_base_sensor);
    } else if (const auto oldest = unmounted_.push(std::move(input))) {
      dropUnmounted(*oldest);
    }
    notePingAges();
  }
  publishers_.publishPing(stamp);
}

void SlamNode::refuse(InputKind kind, Reason reason, const std::string& what) {
  const std::lock_guard lock(mutex_);
  note(kind, reason, what);
}

void SlamNode::refuse(const RefusalCounts& refused) {
  const std::lock_guard lock(mutex_);
  refused_.add(refused);
}

void SlamNode::note(InputKind kind, Reason reason, const std::string& what,
                    std::uint64_t messages) {
  if (messages == 0) return;
  const std::string name = nameOf(kind, reason);
  if (refused_.add(kind, reason, what, messages)) {
    ROS_WARN("First %s: %s", name.c_str(), what.c_str());
  } else {
    ROS_WARN_THROTTLE(kWarningPeriod_s, "%s: %s", name.c_str(), what.c_str());
  }
}

// The filter counts pings that it does not take in, those that waited in it as well, but not why.
void SlamNode::notePingsLost(Reason dropped, const std::string& what_dropped,
                             const std::string& what_rejected) {
  const rbpf_core::Counters now = filter_.snapshot().counters();
  note(InputKind::kPing, dropped, what_dropped, now.pings_dropped - noted_.pings_dropped);
  note(InputKind::kPing, Reason::kNoBeams, what_rejected,
       now.pings_rejected - noted_.pings_rejected);
  noted_ = now;
}

std::optional<Eigen::Isometry3d> SlamNode::mountOf(const std::string& frame) const {
  const std::string& base = params_.frames.base;
  // tf2 knows no frame of which nobody has told it
  if (frame == base) return Eigen::Isometry3d::Identity();
  try {
    return tf2::transformToEigen(transforms_.lookupTransform(base, frame, ros::Time(0)));
  } catch (const tf2::TransformException& error) {
    ROS_WARN_THROTTLE(kWarningPeriod_s, "Pings wait for the mount of '%s' on '%s': %s",
                      frame.c_str(), base.c_str(), error.what());
    return std::nullopt;
  }
}

void SlamNode::takeIn(const PingInput& ping, const Eigen::Isometry3d& T_base_sensor) {
  std::string problem;
  try {
    filter_.addPing(toPing(ping, T_base_sensor));
  } catch (const rbpf_core::InputRefused& refused) {  // the filter has counted it
    problem = refused.what();
  }
  const bool has_odometry = ping.stamp.toSec() <= last_odometry_.toSec();
  // one that may wait is lost only if too many do, or if there is nothing to wait for
  const Reason waiting = finished_ ? Reason::kSurveyOver : Reason::kQueueFull;
  notePingsLost(has_odometry ? Reason::kNoOdometry : waiting, problem, problem);
}

void SlamNode::takeInMounted() {
  for (const std::string& frame : unmounted_.frames()) {
    const auto T_base_sensor = mountOf(frame);
    if (!T_base_sensor) continue;
    for (const PingInput& ping : unmounted_.take(frame)) takeIn(ping, *T_base_sensor);
  }
}

void SlamNode::dropUnmounted(const PingInput& ping) {
  note(InputKind::kPing, Reason::kNoMount,
       "ping of stamp " + std::to_string(ping.stamp.toSec()) + " s dropped: no transform from '" +
           ping.frame + "' to '" + params_.frames.base + "' has come");
}

void SlamNode::notePingAges() {
  if (input_ == Input::kBag) return;
  const rbpf_core::FilterSnapshot filter = filter_.snapshot();
  for (; pings_noted_ < filter.pings(); ++pings_noted_) {
    ages_.add(ros::Time::now().toSec() - filter.record(pings_noted_).stamp_s);
  }
}

void SlamNode::finish() {
  const std::lock_guard lock(mutex_);
  takeInMounted();
  for (const std::string& frame : unmounted_.frames()) {
    for (const PingInput& ping : unmounted_.take(frame)) dropUnmounted(ping);
  }
  filter_.finish();
  finished_ = true;
  notePingsLost(Reason::kNoOdometry, "the survey ended before odometry for a ping came", "");
}

bool SlamNode::serveFinish(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
  finish();
  response.success = true;
  const rbpf_core::FilterSnapshot filter = filter_.snapshot();
  response.message =
      std::to_string(filter.pings()) + " pings, " + std::to_string(filter.beams()) + " beams";
  return true;
}

// ---- loop closing --------------------------------------------------------------------------

void SlamNode::closeLoops() {
  using rbpf_core::StepOutcome;
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
  status.particles = static_cast<std::uint32_t>(params_.filter.particles);
  status.nodes = static_cast<std::uint32_t>(params_.nodes);
  status.n_eff = rbpf_core::effectiveParticles(weights);
  status.best_particle = static_cast<std::uint32_t>(best);
  status.peak_rss_mb = peakResidentMb();
  tellInput(filter, &status);
  tellLoopClosing(&status);
  return status;
}

void SlamNode::tellInput(const rbpf_core::FilterSnapshot& filter,
                         rbpf_svgp_slam::FilterStatus* status) const {
  status->odometry_messages = filter.counters().odometry_messages;
  status->pings = filter.pings();
  status->beams = filter.beams();
  status->beams_held_out = filter.beamsHeldOut();
  status->beams_rejected = filter.counters().beams_rejected;
  const std::lock_guard lock(mutex_);
  status->header.stamp = last_odometry_;
  status->pings_waiting = unmounted_.size() + filter.pingsWaiting();
  status->pings_dropped = refused_.dropped(InputKind::kPing);
  status->pings_rejected = refused_.rejected(InputKind::kPing);
  for (const auto& [what, count] : refused_.counts()) {
    status->refusal_reasons.push_back(nameOf(what.first, what.second));
    status->refusal_counts.push_back(count.messages);
    status->refusal_examples.push_back(count.example);
  }
  status->ping_age_p99_s = ages_.quantile(0.99);
  status->ping_age_max_s = ages_.quantile(1.0);
}

void SlamNode::tellLoopClosing(rbpf_svgp_slam::FilterStatus* status) const {
  const rbpf_core::LoopClosingStatistics closures = loop_closing_.statistics();
  const std::uint32_t epoch = loop_closing_.epoch();
  const rbpf_core::MapsState maps = maps_.state(epoch);
  status->epoch = epoch;
  status->prompts = closures.prompts;
  status->prompts_vetoed = closures.prompts_vetoed;
  status->prompts_skipped = closures.prompts_skipped;
  status->resamplings_failed = closures.resamplings_failed;
  status->maps_moved = closures.moved.maps;
  status->bytes_moved = closures.moved.bytes;
  status->tempering = closures.tempering;
  status->overlap = closures.overlap;
  status->prompt_s = closures.prompt_s;
  status->resampling_s = closures.resampling_s;
  status->maps_ready = static_cast<std::uint32_t>(maps.maps_ready);
  status->iterations = maps.steps;
  status->message = closures.message;
}

void SlamNode::publishOverview() {
  {
    const std::lock_guard lock(mutex_);
    takeInMounted();  // in case a mount has come since the last ping
    notePingAges();
  }
  const rbpf_svgp_slam::FilterStatus now = status();
  publishers_.publishStatus(now);
  if (now.odometry_messages > 0) publishers_.publishOverview(now.header.stamp);
  diagnostics_.update();
}

// ---- diagnostics ---------------------------------------------------------------------------

void SlamNode::diagnoseInput(diagnostic_updater::DiagnosticStatusWrapper& report) const {
  using diagnostic_msgs::DiagnosticStatus;
  const rbpf_svgp_slam::FilterStatus now = status();
  const double age_s = (ros::Time::now() - now.header.stamp).toSec();
  if (now.odometry_messages == 0) {
    report.summary(DiagnosticStatus::WARN, "no odometry yet");
  } else if (age_s > kInputStale_s) {
    report.summaryf(DiagnosticStatus::WARN, "no odometry for %.1f s", age_s);
  } else if (!now.refusal_reasons.empty()) {
    report.summary(DiagnosticStatus::WARN, "messages were lost or refused");
  } else {
    report.summary(DiagnosticStatus::OK, "odometry and pings are coming in");
  }
  report.add("odometry messages", now.odometry_messages);
  report.add("pings", now.pings);
  report.add("pings waiting", now.pings_waiting);
  report.add("pings dropped", now.pings_dropped);
  report.add("pings rejected", now.pings_rejected);
  for (std::size_t i = 0; i < now.refusal_reasons.size(); ++i) {
    report.add(now.refusal_reasons[i],
               std::to_string(now.refusal_counts[i]) + "; first: " + now.refusal_examples[i]);
  }
  report.add("ping age, 99th percentile (s)", now.ping_age_p99_s);
  report.add("beams", now.beams);
  report.add("beams rejected", now.beams_rejected);
}

void SlamNode::diagnoseFilter(diagnostic_updater::DiagnosticStatusWrapper& report) const {
  using diagnostic_msgs::DiagnosticStatus;
  const rbpf_svgp_slam::FilterStatus now = status();
  report.summary(now.resamplings_failed == 0 ? DiagnosticStatus::OK : DiagnosticStatus::WARN,
                 now.message);
  report.add("effective particles", now.n_eff);
  report.add("prompts", now.prompts);
  report.add("prompts vetoed", now.prompts_vetoed);
  report.add("prompts skipped", now.prompts_skipped);
  report.add("resamplings", now.epoch);
  report.add("resamplings failed", now.resamplings_failed);
}

void SlamNode::diagnoseMaps(diagnostic_updater::DiagnosticStatusWrapper& report) const {
  using diagnostic_msgs::DiagnosticStatus;
  const rbpf_core::MapsState maps = maps_.state(loop_closing_.epoch());
  if (maps.nodes_heard < params_.nodes) {
    report.summaryf(DiagnosticStatus::ERROR, "%zu of %zu map nodes have reported", maps.nodes_heard,
                    params_.nodes);
  } else {
    report.summaryf(DiagnosticStatus::OK, "%zu of %zu maps are ready", maps.maps_ready,
                    params_.filter.particles);
  }
  report.add("training steps", maps.steps);
}

}  // namespace rbpf_node
