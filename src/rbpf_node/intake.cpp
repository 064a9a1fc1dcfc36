#include "rbpf_node/intake.hpp"

#include <ros/console.h>
#include <tf2_eigen/tf2_eigen.h>

#include <string>
#include <utility>

namespace rbpf_node {

using rbpf_core::InputKind;
using rbpf_core::Reason;
using rbpf_core::Refusal;

namespace {

constexpr double kWarningPeriod_s = 5.0;
// The year 2000: a clock that shows less has never been set.
constexpr double kClockIsSet_s = 946684800.0;

// tf ignores transforms with broken quaternions, and says so on its own.
std::string noWay(const std::string& frame, const std::string& base) {
  return "no transform from '" + frame + "' to '" + base +
         "' has come, or none whose quaternion is of length 1";
}

}  // namespace

Intake::Intake(const Parameters& params, Input input, const tf2_ros::Buffer& transforms,
               rbpf_core::ParticleFilter* filter)
    : params_(params),
      input_(input),
      transforms_(transforms),
      filter_(*filter),
      mounts_(params.gate.plausibility),
      checks_(params.filter.odometry.velocity, params.survey_area_m),
      unmounted_(params.filter.ping_queue) {}

void Intake::setClockOffset(double offset_s) {
  const std::lock_guard lock(mutex_);
  gate_.emplace(params_.gate, offset_s);
}

void Intake::resume() {
  const std::lock_guard lock(mutex_);
  const rbpf_core::FilterSnapshot filter = filter_.snapshot();
  if (const auto last = filter.latestOdometry()) last_odometry_ = ros::Time(last->stamp_s);
  for (; pings_seen_ < filter.pings(); ++pings_seen_) {
    checks_.add(filter.survey(pings_seen_, 1).front());
  }
}

// Live, stamps that lie long ago from the first one on are those of a bag that is played by its own
// time; those of a clock that has not been set are not taken for such.
rbpf_core::InputGate& Intake::gate(double stamp_s, double receipt_s) {
  if (gate_) return *gate_;
  const double behind_s = receipt_s - stamp_s;
  double offset_s = 0.0;
  if (behind_s > params_.gate.clock.max_behind_s && stamp_s > kClockIsSet_s) {
    offset_s = -behind_s;
    ROS_WARN("Stamps lie %.0f s behind this computer's clock: taken for those of a bag.", behind_s);
  }
  gate_.emplace(params_.gate, offset_s);
  if (const auto last = filter_.snapshot().latestOdometry()) gate_->resume(*last);
  return *gate_;
}

// ---- odometry ------------------------------------------------------------------------------

void Intake::take(const OdometryInput& input, double receipt_s) {
  const rbpf_core::Odometry odometry = toOdometry(input, params_.frames);
  if (receipt_s <= 0.0) receipt_s = odometry.stamp_s;
  const std::lock_guard lock(mutex_);
  if (const auto refusal = gate(odometry.stamp_s, receipt_s).check(odometry, receipt_s)) {
    // what is beyond all bounds may tell what is wrong with all of them
    if (refusal->reason() == Reason::kImplausibleTwist) checks_.add(odometry);
    tellFindings();
    throw *refusal;
  }
  odometry_receipt_age_s_ = gate_->ageOf(odometry.stamp_s, receipt_s);
  try {
    filter_.addOdometry(odometry);
  } catch (const Refusal& refusal) {  // the filter has counted it
    ROS_WARN_THROTTLE(kWarningPeriod_s, "Odometry refused: %s", refusal.what());
    return;
  }
  const double gap_s = input.stamp.toSec() - last_odometry_.toSec();
  if (!last_odometry_.isZero() && gap_s > params_.filter.odometry.gap_s) {
    const bool by_pose = gap_s > params_.filter.odometry.max_bridge_s;
    ROS_WARN("Odometry has a gap of %.2f s before %.3f s; bridged with %s.", gap_s,
             input.stamp.toSec(), by_pose ? "the difference of the poses" : "the mean twist");
  }
  last_odometry_ = input.stamp;
  odometry_frame_ = input.frame;
  checks_.add(odometry);
  lookAtNewPings();
  tellFindings();
}

// ---- pings ---------------------------------------------------------------------------------

void Intake::take(PingInput input, double receipt_s) {
  const std::lock_guard lock(mutex_);
  const double stamp_s = input.stamp.toSec();
  if (receipt_s <= 0.0) receipt_s = stamp_s;
  if (const auto refusal = gate(stamp_s, receipt_s).checkPing(stamp_s, input.frame, receipt_s)) {
    throw *refusal;
  }
  ping_receipt_age_s_ = gate_->ageOf(stamp_s, receipt_s);
  if (paused_) {
    throw Refusal(Reason::kMappingPaused,
                  "ping of stamp " + std::to_string(stamp_s) + " s came while mapping was paused");
  }
  if (input.frame == params_.frames.odom || input.frame == params_.frames.map) {
    takePlaced(input);
    lookAtNewPings();
    tellFindings();
    return;
  }
  takeMounted();  // older ones first
  if (const auto T_base_sensor = mountOf(input.frame)) {
    takeIn(input, *T_base_sensor);
  } else if (const auto oldest = unmounted_.push(std::move(input))) {
    note(InputKind::kPing, Reason::kNoMount,
         "ping of stamp " + std::to_string(oldest->stamp.toSec()) +
             " s dropped: " + noWay(oldest->frame, params_.frames.base));
  }
  filter_.keepOdometrySince(unmounted_.earliestStamp());
  lookAtNewPings();
  tellFindings();
}

bool Intake::setPaused(bool paused) {
  const std::lock_guard lock(mutex_);
  return std::exchange(paused_, paused);
}

// Beams that a driver has placed already: the odometry's own pose takes them back.
void Intake::takePlaced(const PingInput& input) {
  if (input.frame != odometry_frame_.value_or(input.frame)) {
    throw Refusal(Reason::kWrongFrame, "ping's header.frame_id is '" + input.frame +
                                           "', expected the sensor's frame, or '" +
                                           *odometry_frame_ + "', the odometry's");
  }
  rbpf_core::Ping ping = toPing(input, Eigen::Isometry3d::Identity());
  ping.in_odometry_frame = true;
  add(std::move(ping));
}

std::optional<Eigen::Isometry3d> Intake::mountOf(const std::string& frame) {
  const std::string& base = params_.frames.base;
  // tf2 knows no frame of which nobody has told it
  if (frame == base) return Eigen::Isometry3d::Identity();
  try {
    const Eigen::Isometry3d T_base_sensor =
        tf2::transformToEigen(transforms_.lookupTransform(base, frame, ros::Time(0)));
    if (const auto refusal = mounts_.check(frame, T_base_sensor)) throw *refusal;
    return mounts_.inUse(frame);
  } catch (const tf2::TransformException& error) {
    ROS_WARN_THROTTLE(kWarningPeriod_s, "Pings wait for the mount of '%s' on '%s': %s",
                      frame.c_str(), base.c_str(), error.what());
    return std::nullopt;
  }
}

void Intake::takeIn(const PingInput& ping, const Eigen::Isometry3d& T_base_sensor) {
  add(toPing(ping, T_base_sensor));
}

void Intake::add(rbpf_core::Ping ping) {
  try {
    filter_.addPing(std::move(ping));
  } catch (const Refusal& refusal) {  // the filter has counted it
    ROS_WARN_THROTTLE(kWarningPeriod_s, "%s", refusal.what());
  }
}

void Intake::takeMounted() {
  for (const std::string& frame : unmounted_.frames()) {
    std::optional<Eigen::Isometry3d> T_base_sensor;
    try {
      T_base_sensor = mountOf(frame);
    } catch (const Refusal& refusal) {
      for ([[maybe_unused]] const PingInput& ping : unmounted_.take(frame)) {
        note(InputKind::kPing, refusal.reason(), refusal.what());
      }
    }
    if (!T_base_sensor) continue;
    for (const PingInput& ping : unmounted_.take(frame)) takeIn(ping, *T_base_sensor);
  }
  filter_.keepOdometrySince(unmounted_.earliestStamp());
}

void Intake::retryUnmounted() {
  const std::lock_guard lock(mutex_);
  takeMounted();
  lookAtNewPings();
}

// ---- fixes ---------------------------------------------------------------------------------

void Intake::take(const FixInput& input, double receipt_s) {
  const rbpf_core::Fix fix = toFix(input, params_.frames, params_.fix_input);
  if (receipt_s <= 0.0) receipt_s = fix.stamp_s;
  const std::lock_guard lock(mutex_);
  // Whether a bag is played by its own time, odometry and pings tell: a pose that RViz sends before
  // them has this computer's.
  const rbpf_core::InputGate& gate =
      gate_ ? *gate_ : rbpf_core::InputGate(params_.gate, fix.stamp_s - receipt_s);
  if (const auto refusal = gate.checkFix(fix.stamp_s, receipt_s)) throw *refusal;
  try {
    filter_.addFix(fix);
  } catch (const Refusal& refusal) {  // the filter has counted it
    ROS_WARN_THROTTLE(kWarningPeriod_s, "Fix refused: %s", refusal.what());
  }
}

// The filter takes pings in when their odometry comes, which may be later than they.
void Intake::lookAtNewPings() {
  const rbpf_core::FilterSnapshot filter = filter_.snapshot();
  for (; pings_seen_ < filter.pings(); ++pings_seen_) {
    const rbpf_core::SurveyPing ping = filter.survey(pings_seen_, 1).front();
    checks_.add(ping);
    if (input_ == Input::kLive) ages_.add(ros::Time::now().toSec() - ping.record.stamp_s);
  }
}

void Intake::finish() {
  const std::lock_guard lock(mutex_);
  takeMounted();
  for (const std::string& frame : unmounted_.frames()) {
    for (const PingInput& ping : unmounted_.take(frame)) {
      note(InputKind::kPing, Reason::kNoMount,
           "ping of stamp " + std::to_string(ping.stamp.toSec()) +
               " s dropped at the survey's end: " + noWay(frame, params_.frames.base));
    }
  }
  // changes that no ping has come after
  for (const std::string& frame : mounts_.framesInUse()) mountOf(frame);
  filter_.finish();
  lookAtNewPings();
  checks_.finish();
  tellFindings();
}

// ---- what is told --------------------------------------------------------------------------

void Intake::refuse(InputKind kind, Reason reason, const std::string& what) {
  const std::lock_guard lock(mutex_);
  note(kind, reason, what);
}

void Intake::refuse(const rbpf_core::RefusalCounts& refused) {
  const std::lock_guard lock(mutex_);
  refused_.add(refused);
}

void Intake::note(InputKind kind, Reason reason, const std::string& what) {
  const std::string name = nameOf(kind, reason);
  if (refused_.add(kind, reason, what)) {
    ROS_WARN("First %s: %s", name.c_str(), what.c_str());
  } else {
    ROS_WARN_THROTTLE(kWarningPeriod_s, "%s: %s", name.c_str(), what.c_str());
  }
}

std::vector<rbpf_core::Finding> Intake::findings() const {
  std::vector<rbpf_core::Finding> findings = mounts_.findings();
  for (rbpf_core::Finding& finding : checks_.findings()) {
    // a warning of it is of the account of the motion that is not used: harmless
    const bool is_harmless =
        finding.name == "twist_against_pose" && finding.severity == rbpf_core::Severity::kWarning;
    if (!is_harmless) findings.push_back(std::move(finding));
  }
  return findings;
}

void Intake::tellFindings() {
  for (const rbpf_core::Finding& finding : findings()) {
    const bool is_error = finding.severity == rbpf_core::Severity::kError;
    if (!told_.insert(finding.name + (is_error ? "!" : "?")).second) continue;
    if (is_error) {
      ROS_ERROR("%s: %s", finding.name.c_str(), finding.text.c_str());
    } else {
      ROS_WARN("%s: %s", finding.name.c_str(), finding.text.c_str());
    }
  }
  const rbpf_core::FilterSnapshot filter = filter_.snapshot();
  if (filter.odometryUse().intervalsByPose() > 0 && told_.insert("velocity").second) {
    ROS_WARN(
        "The motion is taken from the odometry's pose, for its twist is empty or odometry/velocity "
        "wants it so.");
  }
}

IntakeState Intake::state() const {
  const std::lock_guard lock(mutex_);
  IntakeState state;
  state.last_odometry = last_odometry_;
  state.pings_without_mount = unmounted_.size();
  state.mapping_paused = paused_;
  state.refused = refused_;
  state.refused.add(filter_.snapshot().refused());
  state.findings = findings();
  state.ping_age_p99_s = ages_.quantile(0.99);
  state.ping_age_max_s = ages_.quantile(1.0);
  state.odometry_receipt_age_s = odometry_receipt_age_s_;
  state.ping_receipt_age_s = ping_receipt_age_s_;
  return state;
}

}  // namespace rbpf_node
