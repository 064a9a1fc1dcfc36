#include "rbpf_node/node.hpp"

#include <sys/resource.h>
#include <tf2_eigen/tf2_eigen.h>

#include "rbpf_core/resampling.hpp"
#include "rbpf_node/conversions.hpp"

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
      diagnostics_(node, private_node, ros::this_node::getName()) {
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

void SlamNode::handleOdometry(const nav_msgs::Odometry::ConstPtr& message) {
  try {
    filter_.addOdometry(toOdometry(*message, params_.frames));
  } catch (const std::exception& error) {
    ROS_ERROR_THROTTLE(kWarningPeriod_s, "Odometry refused: %s", error.what());
    return;
  }
  {
    const std::lock_guard lock(mutex_);
    const ros::Time& stamp = message->header.stamp;
    if (!last_odometry_.isZero() && (stamp - last_odometry_).toSec() > params_.odometry_gap_s) {
      ROS_WARN("Odometry has a gap of %.2f s before %.3f s; bridged with the mean twist.",
               (stamp - last_odometry_).toSec(), stamp.toSec());
    }
    last_odometry_ = stamp;
    notePingAges();
  }
  publishers_.publishPose(message->header.stamp);
}

void SlamNode::handlePing(const sensor_msgs::PointCloud2::ConstPtr& message) {
  {
    const std::lock_guard lock(mutex_);
    if (input_ == Input::kLive) countGap(message->header.seq);
    pings_without_mount_.push_back(message);
    if (pings_without_mount_.size() > params_.filter.ping_queue) {
      ++pings_missed_;
      ROS_ERROR_THROTTLE(kWarningPeriod_s,
                         "Ping of stamp %.3f s dropped: no transform from '%s' to '%s' has come.",
                         pings_without_mount_.front()->header.stamp.toSec(),
                         pings_without_mount_.front()->header.frame_id.c_str(),
                         params_.frames.base.c_str());
      pings_without_mount_.pop_front();
    }
  }
  handOnPings();
  publishers_.publishPing(message->header.stamp);
}

void SlamNode::countGap(std::uint32_t seq) {
  if (last_seq_ != 0 && seq > last_seq_ + 1) pings_missed_ += seq - last_seq_ - 1;
  last_seq_ = seq;
}

void SlamNode::handOnPings() {
  const std::lock_guard lock(mutex_);
  while (!pings_without_mount_.empty()) {
    const sensor_msgs::PointCloud2& message = *pings_without_mount_.front();
    const std::string& frame = message.header.frame_id;
    std::string why;
    if (frame.empty() ||
        !transforms_.canTransform(params_.frames.base, frame, ros::Time(0), &why)) {
      ROS_WARN_THROTTLE(kWarningPeriod_s, "%zu pings wait for the mount of '%s' on '%s': %s",
                        pings_without_mount_.size(), frame.c_str(), params_.frames.base.c_str(),
                        why.c_str());
      return;
    }
    try {
      const Eigen::Isometry3d T_base_sensor = tf2::transformToEigen(
          transforms_.lookupTransform(params_.frames.base, frame, ros::Time(0)));
      filter_.addPing(toPing(message, T_base_sensor));
    } catch (const rbpf_core::Refusal& refused) {  // the filter has counted it
      ROS_WARN_THROTTLE(kWarningPeriod_s, "%s", refused.what());
    } catch (const std::exception& error) {
      ++pings_malformed_;
      ROS_ERROR_THROTTLE(kWarningPeriod_s, "Ping of stamp %.3f s refused: %s",
                         message.header.stamp.toSec(), error.what());
    }
    pings_without_mount_.pop_front();
  }
  notePingAges();
}

void SlamNode::notePingAges() {
  if (input_ == Input::kBag) return;
  const rbpf_core::FilterSnapshot filter = filter_.snapshot();
  for (; pings_noted_ < filter.pings(); ++pings_noted_) {
    ages_.add(ros::Time::now().toSec() - filter.record(pings_noted_).stamp_s);
  }
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
  const rbpf_core::Counters counters = filter.counters();
  const rbpf_core::LoopClosingStatistics closures = loop_closing_.statistics();
  const rbpf_core::MapsState maps = maps_.state(loop_closing_.epoch());
  const Eigen::ArrayXd weights = filter.logWeights().exp();
  Eigen::Index best = 0;
  weights.maxCoeff(&best);
  {
    const std::lock_guard lock(mutex_);
    status.header.stamp = last_odometry_;
    status.pings_waiting = pings_without_mount_.size() + filter.pingsWaiting();
    status.pings_dropped = pings_missed_ + counters.pings_dropped;
    status.pings_rejected = pings_malformed_ + counters.pings_rejected;
    status.ping_age_p99_s = ages_.quantile(0.99);
    status.ping_age_max_s = ages_.quantile(1.0);
  }
  status.header.frame_id = params_.frames.map;
  status.particles = static_cast<std::uint32_t>(params_.filter.particles);
  status.nodes = static_cast<std::uint32_t>(params_.nodes);
  status.odometry_messages = counters.odometry_messages;
  status.pings = filter.pings();
  status.beams = filter.beams();
  status.beams_held_out = filter.beamsHeldOut();
  status.beams_rejected = counters.beams_rejected;
  status.epoch = loop_closing_.epoch();
  status.prompts = closures.prompts;
  status.prompts_vetoed = closures.prompts_vetoed;
  status.prompts_skipped = closures.prompts_skipped;
  status.resamplings_failed = closures.resamplings_failed;
  status.maps_moved = closures.moved.maps;
  status.bytes_moved = closures.moved.bytes;
  status.n_eff = rbpf_core::effectiveParticles(weights);
  status.tempering = closures.tempering;
  status.overlap = closures.overlap;
  status.prompt_s = closures.prompt_s;
  status.resampling_s = closures.resampling_s;
  status.maps_ready = static_cast<std::uint32_t>(maps.maps_ready);
  status.iterations = maps.steps;
  status.best_particle = static_cast<std::uint32_t>(best);
  status.peak_rss_mb = peakResidentMb();
  status.message = closures.message;
  return status;
}

void SlamNode::publishOverview() {
  handOnPings();  // in case the mount has come since the last ping
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
  } else if (now.pings_dropped + now.pings_rejected > 0) {
    report.summary(DiagnosticStatus::WARN, "pings were lost or refused");
  } else {
    report.summary(DiagnosticStatus::OK, "odometry and pings are coming in");
  }
  report.add("odometry messages", now.odometry_messages);
  report.add("pings", now.pings);
  report.add("pings waiting", now.pings_waiting);
  report.add("pings dropped", now.pings_dropped);
  report.add("pings rejected", now.pings_rejected);
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
