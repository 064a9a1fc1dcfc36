#include "rbpf_core/smoothing/past_smoothing.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

#include "rbpf_core/rigid.hpp"

namespace rbpf_core::smoothing {

namespace {

SmoothingParams withFilters(SmoothingParams smoothing, const FilterParams& filter) {
  smoothing.motion = filter.motion;
  smoothing.start_position_std_m = filter.start_position_std_m;
  smoothing.start_yaw_std_rad = filter.start_yaw_std_rad;
  return smoothing;
}

// What is left of a symmetric matrix without its negative directions. Lengths for angles: a radian
// counts as so many metres.
Eigen::Matrix3d positivePart(const Eigen::Matrix3d& symmetric) {
  constexpr double kArm_m = 20.0;
  const Eigen::Vector3d scale(1.0, 1.0, kArm_m);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(scale.asDiagonal() * symmetric *
                                                             scale.asDiagonal());
  const Eigen::Matrix3d V = scale.cwiseInverse().asDiagonal() * eigen.eigenvectors();
  return V * eigen.eigenvalues().cwiseMax(0.0).asDiagonal() * V.transpose();
}

}  // namespace

Eigen::Matrix3d largerOf(const Eigen::Matrix3d& spread, const Eigen::Matrix3d& covariance) {
  return spread + positivePart(covariance - spread);
}

PastSmoothing::PastSmoothing(const ParticleFilter& filter, const PastSmoothingParams& params)
    : filter_(filter), params_(params), last_s_(std::numeric_limits<double>::quiet_NaN()) {
  // A parameter that is out of range is told now, not at the first ping.
  const Smoother check(withFilters(params_.smoothing, filter.params()), 0.0, Pose2{});
}

bool PastSmoothing::isDue() const {
  if (params_.period_s <= 0.0) return false;
  const FilterSnapshot snapshot = filter_.snapshot();
  const auto latest_s = snapshot.latestPingStamp();
  if (!latest_s) return false;
  const std::lock_guard lock(mutex_);
  const double since_s = std::isnan(last_s_) ? snapshot.start()->stamp_s : last_s_;
  return *latest_s - since_s >= params_.period_s;
}

std::shared_ptr<const SmoothedPast> PastSmoothing::result() const {
  const std::lock_guard lock(mutex_);
  return result_;
}

std::optional<PastCorrection> PastSmoothing::smooth(bool is_over) {
  const auto start = std::chrono::steady_clock::now();
  const FilterSnapshot snapshot = filter_.snapshot();
  if (snapshot.pings() == 0) return std::nullopt;
  takePings(snapshot);
  if (is_over) smoother_->finishPings();
  smoother_->update();
  if (is_over) smoother_->registerAgain();

  SmoothedPast result = *this->result();
  result.closures = smoother_->closures();
  result.accepted = smoother_->accepted();
  result.nodes = smoother_->graph().poses();
  if (is_over) {
    const std::vector<Eigen::Matrix3d> of_pings = smoother_->covariancesOfPings();
    result.covariances.clear();
    for (const std::size_t ping : stands_for_) result.covariances.push_back(of_pings[ping]);
  }
  auto correction = this->correction(snapshot, &result);
  result.seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  const std::lock_guard lock(mutex_);
  result_ = std::make_shared<const SmoothedPast>(std::move(result));
  last_s_ = *snapshot.latestPingStamp();
  return correction;
}

void PastSmoothing::takePings(const FilterSnapshot& snapshot) {
  if (!smoother_) {
    smoother_ = std::make_unique<Smoother>(withFilters(params_.smoothing, filter_.params()),
                                           snapshot.start()->stamp_s, snapshot.start()->pose);
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

// C(t) = X~(t) X(t)^-1, X the mean of the histories.
std::optional<PastCorrection> PastSmoothing::correction(const FilterSnapshot& snapshot,
                                                        SmoothedPast* result) {
  if (!smoother_->hasClosures()) return std::nullopt;
  const Eigen::ArrayXd weights = snapshot.logWeights().exp();
  const std::vector<Pose2> smoothed = smoother_->posesOfPings();
  PastCorrection correction;
  double change2 = 0.0;
  FilterSnapshot::Past past;
  for (std::size_t i = 0; i < stands_for_.size(); ++i) {
    const bool stands_for_itself = i == 0 || stands_for_[i] != stands_for_[i - 1];
    if (!stands_for_itself) {
      correction.of_ping.push_back(correction.of_ping.back());
      continue;
    }
    past = snapshot.pastAt(i, weights);
    const Pose2& to = smoothed[stands_for_[i]];
    correction.of_ping.push_back(compose(to, inverse(past.mean)));
    const double dx = to.x_m - past.mean.x_m;
    const double dy = to.y_m - past.mean.y_m;
    change2 = std::max(change2, dx * dx + dy * dy);
  }
  if (std::sqrt(change2) < params_.min_change_m) return std::nullopt;
  result->largest_change_m = std::sqrt(change2);
  correction.of_rest = correction.of_ping.back();
  correction.bias = smoother_->graph().bias();
  const std::size_t last = smoother_->graph().size() - 1;
  correction.common_error.at = smoothed.back();
  correction.common_error.covariance =
      positivePart(PoseGraph::Covariances(smoother_->graph()).of(last) - past.spread);
  return correction;
}

}  // namespace rbpf_core::smoothing
