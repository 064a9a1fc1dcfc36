#include "rbpf_core/particle_filter.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <unordered_map>

#include "rbpf_core/decimal.hpp"

namespace rbpf_core {

namespace {

// A ping may come this much later than the odometry of its stamp: a core that has stood still has
// all of the odometry in between before it has the pings.
constexpr double kRecent_s = 60.0;
// And this much where it is known that it will come: a mount that never comes must not fill memory.
constexpr double kKeptAtMost_s = 120.0;

bool isFinite(const Odometry& odometry) {
  const Attitude& a = odometry.attitude;
  const Pose2& p = odometry.pose;
  return odometry.linear_mps.allFinite() && odometry.angular_radps.allFinite() &&
         Eigen::Array<double, 7, 1>{odometry.stamp_s, a.z_m, a.roll_rad, a.pitch_rad, p.x_m, p.y_m,
                                    p.yaw_rad}
             .isFinite()
             .all();
}

std::vector<RandomStream> streamsFor(StreamPurpose purpose, const FilterParams& params) {
  std::vector<RandomStream> streams;
  for (std::size_t j = 0; j < params.particles; ++j) {
    streams.push_back(makeStream(params.seed, purpose, j));
  }
  return streams;
}

std::shared_ptr<const Eigen::ArrayXd> uniformLogWeights(std::size_t particles) {
  const auto J = static_cast<double>(particles);
  return std::make_shared<const Eigen::ArrayXd>(
      Eigen::ArrayXd::Constant(static_cast<Eigen::Index>(particles), -std::log(J)));
}

std::string nameOf(const Ping& ping) { return "ping of stamp " + decimal(ping.stamp_s, 3) + " s"; }

}  // namespace

ParticleFilter::ParticleFilter(const FilterParams& params)
    : params_(params),
      motion_streams_(streamsFor(StreamPurpose::kMotion, params)),
      histories_(params.particles),
      odometry_use_(params.odometry),
      minibatch_calls_(params.particles) {
  published_.params_ = &params_;
  published_.log_ = &log_;
  published_.minibatch_calls_ = &minibatch_calls_;
  published_.trajectories_ = histories_.trajectories();
  published_.log_weights_ = uniformLogWeights(params.particles);
  published_.refused_ = refused_;
}

void ParticleFilter::observe(ChangeObserver* observer) {
  const std::lock_guard lock(writer_mutex_);
  observer_ = observer;
}

void ParticleFilter::settle() {
  if (ChangeObserver* observer = observer_) observer->settle();
}

// ---- odometry: the particles move ----------------------------------------------------------

void ParticleFilter::addOdometry(const Odometry& odometry) {
  const WriterLock lock(this);
  tell(odometry);
  expectUsable(odometry);
  if (recent_.empty()) {
    odometry_use_.start(odometry);
    start(odometry);
  } else {
    recent_.push_back(
        std::make_shared<const StampedParticles>(propagate(*recent_.back(), odometry)));
  }
  ++counters_.odometry_messages;
  const double keep_since_s =
      std::clamp(keep_since_s_.value_or(odometry.stamp_s), odometry.stamp_s - kKeptAtMost_s,
                 odometry.stamp_s - std::max(kRecent_s, params_.fixes.max_late_s));
  while (recent_.size() > 2 && recent_[1]->odometry.stamp_s < keep_since_s) recent_.pop_front();
  takeInWaiting();
  releaseHeldBack();
}

void ParticleFilter::keepOdometrySince(std::optional<double> stamp_s) {
  const std::lock_guard lock(writer_mutex_);
  if (stamp_s == keep_since_s_) return;
  tell(OdometryKept{stamp_s});
  keep_since_s_ = stamp_s;
}

void ParticleFilter::expectUsable(const Odometry& odometry) {
  const std::string name = "odometry of stamp " + decimal(odometry.stamp_s, 3) + " s";
  if (!isFinite(odometry)) {
    throw refuse(InputKind::kOdometry, Reason::kNotFinite,
                 name + " holds a value that is not finite");
  }
  if (recent_.empty()) return;
  const double last_s = recent_.back()->odometry.stamp_s;
  if (odometry.stamp_s > last_s) return;
  throw refuse(InputKind::kOdometry,
               odometry.stamp_s == last_s ? Reason::kDuplicateStamp : Reason::kOutOfOrder,
               name + ": expected a stamp later than the one before, " + decimal(last_s, 3) + " s");
}

StampedParticles ParticleFilter::propagate(const StampedParticles& from, const Odometry& odometry) {
  const MotionSource source = motionSource(from.odometry, odometry, params_.odometry);
  const MotionIncrement motion = source == MotionSource::kTwist
                                     ? motionBetween(from.odometry, odometry)
                                     : motionOfPoses(from.odometry, odometry);
  odometry_use_.add(from.odometry, odometry, source);
  const MotionIncrement unbiased{motion.duration_s,
                                 motion.forward_m - bias_.surge_mps * motion.duration_s,
                                 motion.left_m - bias_.sway_mps * motion.duration_s,
                                 motion.yaw_rad - bias_.yaw_radps * motion.duration_s};
  StampedParticles to{odometry, advance(from.dead_reckoning, motion), from.poses};
  for (std::size_t j = 0; j < to.poses.size(); ++j) {
    to.poses[j] = advanceNoisily(from.poses[j], unbiased, params_.motion, motion_streams_[j]);
    to.poses[j].x_m += bias_.current_x_mps * motion.duration_s;
    to.poses[j].y_m += bias_.current_y_mps * motion.duration_s;
  }
  return to;
}

// ---- pings: the log and the histories grow -------------------------------------------------

void ParticleFilter::addPing(Ping ping) {
  const WriterLock lock(this);
  tell(ping);
  if (!std::isfinite(ping.stamp_s)) {
    throw refuse(InputKind::kPing, Reason::kNotFinite, "ping's stamp is not finite");
  }
  if (finished_) {
    throw refuse(InputKind::kPing, Reason::kSurveyOver,
                 nameOf(ping) + " came after the survey's end");
  }
  if (!recent_.empty() && ping.stamp_s <= recent_.back()->odometry.stamp_s) return takeIn(ping);
  const double stamp_s = ping.stamp_s;
  waiting_.emplace(stamp_s, std::move(ping));
  if (waiting_.size() <= params_.ping_queue) return;
  const std::string oldest = nameOf(waiting_.begin()->second);
  waiting_.erase(waiting_.begin());
  throw refuse(InputKind::kPing, Reason::kQueueFull,
               oldest + " dropped: " + std::to_string(params_.ping_queue) +
                   " pings wait for odometry at or after their stamps");
}

void ParticleFilter::takeInWaiting() {
  const double now_s = recent_.back()->odometry.stamp_s;
  while (!waiting_.empty() && waiting_.begin()->first <= now_s) {
    try {
      takeIn(waiting_.begin()->second);
    } catch (const Refusal&) {
      // it has been counted, and this caller has not brought it
    }
    waiting_.erase(waiting_.begin());
  }
  while (!waiting_fixes_.empty() && waiting_fixes_.begin()->first <= now_s) {
    try {
      takeIn(waiting_fixes_.begin()->second);
    } catch (const Refusal&) {
      // as above
    }
    waiting_fixes_.erase(waiting_fixes_.begin());
  }
}

std::deque<StampedParticles::ConstPtr>::const_iterator ParticleFilter::firstNotBefore(
    double stamp_s) const {
  return std::lower_bound(
      recent_.begin(), recent_.end(), stamp_s,
      [](const auto& particles, double stamp) { return particles->odometry.stamp_s < stamp; });
}

void ParticleFilter::expectPoseAt(double stamp_s, InputKind kind, const std::string& name) {
  const double first_s = recent_.front()->odometry.stamp_s;
  if (stamp_s < first_s) {
    throw refuse(
        kind, Reason::kNoOdometry,
        name + " dropped: the odometry kept begins at " + decimal(first_s, 3) + " s. " +
            (kind == InputKind::kPing
                 ? "Do pings come late, or is the sonar's clock behind?"
                 : "Do fixes come later than fixes/max_late_s, or is their clock behind?"));
  }
  const auto after = firstNotBefore(stamp_s);
  const double after_s = (*after)->odometry.stamp_s;
  if (after_s == stamp_s) return;
  const double before_s = (*std::prev(after))->odometry.stamp_s;
  if (after_s - before_s <= params_.odometry.max_bridge_s) return;
  throw refuse(kind, Reason::kInGap,
               name + " dropped: there is no odometry from " + decimal(before_s, 3) + " to " +
                   decimal(after_s, 3) + " s, and no pose is known for longer than " +
                   decimal(params_.odometry.max_bridge_s, 1) + " s without");
}

StampedParticles ParticleFilter::particlesAt(double stamp_s) const {
  const auto after = firstNotBefore(stamp_s);
  const StampedParticles& b = **after;
  if (b.odometry.stamp_s == stamp_s) return b;
  const StampedParticles& a = **std::prev(after);
  const double share = (stamp_s - a.odometry.stamp_s) / (b.odometry.stamp_s - a.odometry.stamp_s);
  StampedParticles between = a;
  between.odometry.stamp_s = stamp_s;
  between.odometry.pose = interpolate(a.odometry.pose, b.odometry.pose, share);
  between.odometry.attitude = interpolate(a.odometry.attitude, b.odometry.attitude, share);
  between.dead_reckoning = interpolate(a.dead_reckoning, b.dead_reckoning, share);
  for (std::size_t j = 0; j < between.poses.size(); ++j) {
    between.poses[j] = interpolate(a.poses[j], b.poses[j], share);
  }
  return between;
}

void ParticleFilter::takeIn(const Ping& ping) {
  expectPoseAt(ping.stamp_s, InputKind::kPing, nameOf(ping));
  const StampedParticles particles = particlesAt(ping.stamp_s);
  const Attitude& attitude = particles.odometry.attitude;
  const Beams beams =
      goodBeams(ping.in_odometry_frame ? inBaseLink(ping, particles.odometry) : ping, attitude,
                params_.pings);
  counters_.beams_rejected += static_cast<std::uint64_t>(ping.beams_m.cols() - beams.cols());
  if (beams.cols() == 0) {
    throw refuse(InputKind::kPing, Reason::kNoBeams,
                 nameOf(ping) + ": none of its " + std::to_string(ping.beams_m.cols()) +
                     " beams is finite and within range");
  }
  const bool held_out = isHeldOut(log_.pings.size());
  MbesLog& beam_log = held_out ? log_.held_out : log_.training;
  const Eigen::ArrayXd w = weights();
  const Pose2 online = weightedMean(particles.poses, w);
  const PoseSlot slot = histories_.append(particles.poses);
  log_.pings.push_back({ping.stamp_s, attitude, particles.dead_reckoning, online,
                        covarianceOfEstimate(particles, w, online, known_error_, params_.motion),
                        slot, beam_log.size(), static_cast<std::uint32_t>(beams.cols()), held_out});
  beam_log.append(slot, beams);
  releaseHeldBack();
}

Eigen::ArrayXd ParticleFilter::weights() const {
  return published_.log_weights_->exp();  // only writers replace them
}

bool ParticleFilter::isHeldOut(std::size_t ping) const {
  // every (1/holdout)-th ping
  const double share = params_.holdout;
  return std::floor(static_cast<double>(ping + 1) * share) >
         std::floor(static_cast<double>(ping) * share);
}

void ParticleFilter::releaseHeldBack() {
  if (recent_.empty()) return;
  const double youngest_s = recent_.back()->odometry.stamp_s - params_.hold_back_s;
  while (released_pings_ < log_.pings.size() &&
         (finished_ || log_.pings[released_pings_].stamp_s <= youngest_s)) {
    const PingRecord& record = log_.pings[released_pings_++];
    if (!record.held_out) released_beams_ = record.first_beam + record.beams;
  }
}

void ParticleFilter::finish() {
  const WriterLock lock(this);
  tell(SurveyFinished{});
  finished_ = true;
  refuse(InputKind::kPing, Reason::kNoOdometry, "the survey ended before odometry for a ping came",
         waiting_.size());
  waiting_.clear();
  refuse(InputKind::kFix, Reason::kNoOdometry, "the survey ended before odometry for a fix came",
         waiting_fixes_.size());
  waiting_fixes_.clear();
  releaseHeldBack();
}

void ParticleFilter::goOn() {
  const WriterLock lock(this);
  finished_ = false;
}

// ---- weights and resampling ----------------------------------------------------------------

void ParticleFilter::setLogWeights(const Eigen::ArrayXd& log_weights) {
  if (log_weights.size() != static_cast<Eigen::Index>(params_.particles) ||
      !log_weights.allFinite()) {
    throw std::invalid_argument("log weights: expected " + std::to_string(params_.particles) +
                                " finite values, got " + std::to_string(log_weights.size()) +
                                (log_weights.allFinite() ? "" : ", some not finite"));
  }
  auto weights = std::make_shared<const Eigen::ArrayXd>(log_weights);
  WriterLock lock(this);
  tell(WeightsSet{log_weights});
  lock.new_log_weights = std::move(weights);
}

template <typename Prepare, typename Change, typename Commit>
void ParticleFilter::replacePast(const Prepare& prepare, const Change& change,
                                 const Commit& commit) {
  const auto changed = [&](const StampedParticles& before) {
    StampedParticles after = before;
    change(before.poses, &after.poses);
    return std::make_shared<const StampedParticles>(std::move(after));
  };
  TrajectoryHistories::State state;
  std::deque<StampedParticles::ConstPtr> recent;
  std::size_t pings = 0;
  {
    const std::lock_guard lock(writer_mutex_);
    state = histories_.state();
    recent = recent_;
    pings = log_.pings.size();
  }
  auto prepared = prepare(state, pings);
  std::unordered_map<StampedParticles::ConstPtr, StampedParticles::ConstPtr> after;
  for (const auto& before : recent) after[before] = changed(*before);

  // What is left is the exchange of pointers, and what has come since.
  WriterLock lock(this);
  commit(std::move(prepared), &lock);
  for (StampedParticles::ConstPtr& particles : recent_) {
    const auto found = after.find(particles);
    particles = found != after.end() ? found->second : changed(*particles);
  }
  for (FixToWeigh& fix : to_weigh_) fix.particles = changed(*fix.particles);
}

void ParticleFilter::resample(const std::vector<std::uint32_t>& ancestors) {
  const std::lock_guard one_at_a_time(resampling_mutex_);
  auto weights = uniformLogWeights(ancestors.size());
  replacePast(
      [&](const TrajectoryHistories::State& state, std::size_t) {
        return TrajectoryHistories::prepareResampling(ancestors, state);  // checks them
      },
      [&](const std::vector<Pose2>& before, std::vector<Pose2>* after) {
        for (std::size_t j = 0; j < ancestors.size(); ++j) (*after)[j] = before[ancestors[j]];
      },
      [&](TrajectoryHistories::PreparedResampling prepared, WriterLock* lock) {
        tell(Resampled{ancestors});
        histories_.commitResampling(std::move(prepared));
        lock->new_log_weights = std::move(weights);
      });
  settle();
}

void ParticleFilter::setKnownError(const KnownError& error) {
  const WriterLock lock(this);
  tell(error);
  known_error_ = error;
}

// ---- corrections of the past ---------------------------------------------------------------

void ParticleFilter::correctPast(const PastCorrection& correction) {
  expectSound(correction);
  const std::lock_guard one_at_a_time(resampling_mutex_);
  if (correction.redraws != snapshot().redraws()) {
    throw std::invalid_argument(
        "correction of the past: found out before the particles were drawn anew, expected after");
  }
  const RigidMotion of_rest = RigidMotion::of(correction.of_rest);
  replacePast(
      [&](const TrajectoryHistories::State& state, std::size_t pings) {
        return TrajectoryHistories::prepareCorrection(motionsBySlot(correction, pings), of_rest,
                                                      state);
      },
      [&](const std::vector<Pose2>&, std::vector<Pose2>* poses) {
        for (Pose2& pose : *poses) pose = move(correction.of_rest, pose);
      },
      [&](TrajectoryHistories::PreparedCorrection prepared, WriterLock*) {
        tell(correction);
        histories_.commitCorrection(std::move(prepared));
        bias_ = correction.bias;
        if (correction.maps_follow) ++past_;
      });
}

std::vector<RigidMotion> ParticleFilter::motionsBySlot(const PastCorrection& correction,
                                                       std::size_t pings) const {
  const std::vector<PingMotion>& told = correction.of_pings;
  if (!told.empty() && told.back().ping >= pings) {
    throw std::invalid_argument("correction up to ping " + std::to_string(told.back().ping) +
                                ", expected one of the " + std::to_string(pings) + " in the log");
  }
  const std::vector<Pose2> of_ping = motionOfEach(told);
  // slots rise from ping to ping; those that no ping has may move as they like
  std::vector<RigidMotion> of_slot;
  for (std::size_t i = 0; i < of_ping.size(); ++i) {
    of_slot.resize(log_.pings[i].slot + std::size_t{1});
    of_slot.back() = RigidMotion::of(of_ping[i]);
  }
  return of_slot;
}

// ---- what is refused -----------------------------------------------------------------------

Refusal ParticleFilter::refuse(InputKind kind, Reason reason, const std::string& what,
                               std::size_t messages) {
  RefusalCounts counts = *refused_;
  counts.add(kind, reason, what, messages);
  counters_.odometry_rejected = counts.rejected(InputKind::kOdometry);
  counters_.pings_rejected = counts.rejected(InputKind::kPing);
  counters_.pings_dropped = counts.dropped(InputKind::kPing);
  refused_ = std::make_shared<const RefusalCounts>(std::move(counts));
  return Refusal(reason, what);
}

// ---- what readers see ----------------------------------------------------------------------

void ParticleFilter::publishSnapshot(std::shared_ptr<const Eigen::ArrayXd> new_log_weights) {
  const std::lock_guard lock(published_mutex_);
  if (new_log_weights) published_.log_weights_ = std::move(new_log_weights);
  published_.trajectories_ = histories_.trajectories();
  published_.particles_ = recent_.empty() ? nullptr : recent_.back();
  published_.fixes_ = log_.fixes.size();
  published_.pings_ = log_.pings.size();
  published_.pings_waiting_ = waiting_.size();
  published_.beams_ = log_.training.size();
  published_.beams_released_ = released_beams_;
  published_.beams_held_out_ = log_.held_out.size();
  published_.counters_ = counters_;
  published_.refused_ = refused_;
  published_.odometry_use_ = odometry_use_;
  published_.past_ = past_;
  published_.bias_ = bias_;
  published_.known_error_ = known_error_;
  published_.start_ = start_;
  published_.redraws_ = redraws_;
  published_.redrawn_s_ = redrawn_s_;
  published_.finished_ = finished_;
}

FilterSnapshot ParticleFilter::snapshot() const {
  const std::lock_guard lock(published_mutex_);
  return published_;
}

}  // namespace rbpf_core
