#include "rbpf_core/smoothing/past_smoothing.hpp"

#include <time.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "rbpf_core/rigid.hpp"

namespace rbpf_core::smoothing {

namespace {

SmoothingParams withFilters(SmoothingParams smoothing, const FilterParams& filter,
                            double start_position_std_m, double start_yaw_std_rad) {
  smoothing.motion = filter.motion;
  smoothing.start_position_std_m = start_position_std_m;
  smoothing.start_yaw_std_rad = start_yaw_std_rad;
  return smoothing;
}

// Of what the smoother takes; there are pings.
double latestStamp(const FilterSnapshot& snapshot) {
  const double ping_s = *snapshot.latestPingStamp();
  if (snapshot.fixes() == 0) return ping_s;
  return std::max(ping_s, snapshot.fix(snapshot.fixes() - 1).fix.stamp_s);
}

// Of this thread: what else the machine has to do does not count.
double processorSeconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

// So much later than a fix there will be no ping of its time, s.
constexpr double kLatePing_s = 10.0;

// Of corrections but the last one: the smoother knows the past no better than to centimetres, and a
// journal is to have room for a correction of it twice a minute.
constexpr MotionTolerance kTolerance{0.01, 3e-4};

}  // namespace

PastSmoothing::PastSmoothing(const ParticleFilter& filter, const PastSmoothingParams& params)
    : filter_(filter), params_(params), last_s_(std::numeric_limits<double>::quiet_NaN()) {
  // A parameter that is out of range is told now, not at the first ping.
  const FilterParams& of_filter = filter.params();
  const Smoother check(withFilters(params_.smoothing, of_filter, of_filter.start_position_std_m,
                                   of_filter.start_yaw_std_rad),
                       0.0, Pose2{});
}

bool PastSmoothing::isDue() const {
  if (params_.period_s <= 0.0) return false;
  const FilterSnapshot snapshot = filter_.snapshot();
  if (snapshot.pings() == 0) return false;
  const std::lock_guard lock(mutex_);
  const double since_s = std::isnan(last_s_) ? snapshot.start()->stamp_s : last_s_;
  return latestStamp(snapshot) - since_s >= params_.period_s;
}

void PastSmoothing::putOff() {
  const auto latest_s = filter_.snapshot().latestPingStamp();
  const std::lock_guard lock(mutex_);
  if (latest_s) last_s_ = *latest_s;
}

std::shared_ptr<const SmoothedPast> PastSmoothing::result() const {
  const std::lock_guard lock(mutex_);
  return result_;
}

PastSmoothing::News PastSmoothing::smooth(bool is_over) {
  const double start_s = processorSeconds();
  const FilterSnapshot snapshot = filter_.snapshot();
  if (snapshot.pings() == 0) return {};
  takePings(snapshot);
  takeFixes(snapshot, is_over);
  if (is_over) smoother_->finishPings();
  smoother_->update();
  if (is_over) smoother_->registerAgain();

  SmoothedPast result = *this->result();
  result.closures = smoother_->closures();
  result.accepted = smoother_->accepted();
  result.fixes = smoother_->fixes();
  result.nodes = smoother_->graph().poses();
  if (is_over) {
    const std::vector<Eigen::Matrix3d> of_pings = smoother_->covariancesOfPings();
    result.covariances.clear();
    for (const std::size_t ping : stands_for_) result.covariances.push_back(of_pings[ping]);
  }
  News news;
  news.correction = correction(snapshot, is_over, &result);
  const std::size_t last = smoother_->graph().size() - 1;
  news.known_error = KnownError{smoother_->track().nodes()[last].stamp_s, result.nodes[last],
                                smoother_->covariances().of(last), smoother_->lastGoodFix()};
  result.processor_s += processorSeconds() - start_s;
  const std::lock_guard lock(mutex_);
  result_ = std::make_shared<const SmoothedPast>(std::move(result));
  last_s_ = latestStamp(snapshot);
  return news;
}

void PastSmoothing::takePings(const FilterSnapshot& snapshot) {
  if (!smoother_) {
    const FilterSnapshot::Start& start = *snapshot.start();
    smoother_ = std::make_unique<Smoother>(
        withFilters(params_.smoothing, filter_.params(), start.position_std_m, start.yaw_std_rad),
        start.stamp_s, start.pose);
  }
  for (; taken_ < snapshot.pings(); ++taken_) {
    const PingRecord& ping = snapshot.record(taken_);
    const std::vector<PingPlace>& pings = smoother_->track().pings();
    if (pings.empty() || ping.stamp_s >= pings.back().stamp_s) {
      smoother_->addPing(ping.stamp_s, ping.dead_reckoning, snapshot.beamsOf(ping));
    }
    stands_for_.push_back(pings.size() - 1);
  }
}

// Those that are younger than the last ping wait: a ping of their time may be on its way.
void PastSmoothing::takeFixes(const FilterSnapshot& snapshot, bool is_over) {
  for (; fixes_seen_ < snapshot.fixes(); ++fixes_seen_) {
    waiting_fixes_.push_back(snapshot.fix(fixes_seen_));
  }
  std::stable_sort(
      waiting_fixes_.begin(), waiting_fixes_.end(),
      [](const FixRecord& a, const FixRecord& b) { return a.fix.stamp_s < b.fix.stamp_s; });
  const double known_s = std::max(smoother_->track().pings().back().stamp_s,
                                  snapshot.estimate().stamp_s - kLatePing_s);
  auto fix = waiting_fixes_.begin();
  for (; fix != waiting_fixes_.end() && (is_over || fix->fix.stamp_s <= known_s); ++fix) {
    smoother_->addFix(*fix);
  }
  waiting_fixes_.erase(waiting_fixes_.begin(), fix);
}

// C(t) = X~(t) X(t)^-1, X the mean of the histories.
std::optional<PastCorrection> PastSmoothing::correction(const FilterSnapshot& snapshot,
                                                        bool is_over, SmoothedPast* result) {
  if (!smoother_->knowsMore()) return std::nullopt;
  const Eigen::ArrayXd weights = snapshot.logWeights().exp();
  const std::vector<Pose2> smoothed = smoother_->posesOfPings();
  const MotionTolerance tolerance = is_over ? MotionTolerance{} : kTolerance;
  std::vector<Pose2> means;
  std::vector<Pose2> motions;
  double change2 = 0.0;
  for (std::size_t i = 0; i < stands_for_.size(); ++i) {
    const Pose2& from = means.emplace_back(snapshot.pastAt(i, weights).mean);
    const bool stands_for_itself = i == 0 || stands_for_[i] != stands_for_[i - 1];
    if (!stands_for_itself) {
      motions.push_back(motions.back());
      continue;
    }
    const Pose2& to = smoothed[stands_for_[i]];
    motions.push_back(tolerance.holds(from, to) ? Pose2{} : compose(to, inverse(from)));
    const double dx = to.x_m - from.x_m;
    const double dy = to.y_m - from.y_m;
    change2 = std::max(change2, dx * dx + dy * dy);
  }
  const double change_m = std::sqrt(change2);
  // A correction that was found out before it was not made, though maps may have been to follow.
  if (std::exchange(redraws_, snapshot.redraws()) != snapshot.redraws()) {
    not_followed_m_ = std::numeric_limits<double>::infinity();
  }
  if (change_m < params_.min_change_m && not_followed_m_ == 0.0) return std::nullopt;
  result->largest_change_m = change_m;
  not_followed_m_ += change_m;
  PastCorrection correction;
  correction.of_pings = thinned(motions, means, tolerance);
  correction.maps_follow = is_over || not_followed_m_ > params_.map_tolerance_m;
  if (correction.maps_follow) not_followed_m_ = 0.0;
  // After the last ping the particles may have been put where an operator says that they are.
  const double last_ping_s = snapshot.record(stands_for_.size() - 1).stamp_s;
  const bool is_redrawn_since = snapshot.redrawnStamp() && *snapshot.redrawnStamp() >= last_ping_s;
  if (!is_redrawn_since) correction.of_rest = motions.back();
  correction.redraws = snapshot.redraws();
  correction.bias = smoother_->graph().bias();
  return correction;
}

}  // namespace rbpf_core::smoothing
