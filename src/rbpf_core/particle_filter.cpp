#include "rbpf_core/particle_filter.hpp"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <random>
#include <shared_mutex>
#include <stdexcept>

#include "rbpf_core/resampling.hpp"

namespace rbpf_core {

namespace {

constexpr double kRecent_s =
    10.0;  // a ping may come this much later than the odometry of its stamp

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

}  // namespace

ParticleFilter::ParticleFilter(const FilterParams& params)
    : params_(params),
      motion_streams_(streamsFor(StreamPurpose::kMotion, params)),
      histories_(params.particles),
      log_weights_(Eigen::ArrayXd::Constant(static_cast<Eigen::Index>(params.particles),
                                            -std::log(static_cast<double>(params.particles)))),
      minibatch_calls_(params.particles) {}

// ---- odometry: the particles move ----------------------------------------------------------

void ParticleFilter::addOdometry(const Odometry& odometry) {
  std::unique_lock lock(mutex_);
  if (!isFinite(odometry)) {
    ++counters_.odometry_rejected;
    throw std::invalid_argument("odometry of stamp " + std::to_string(odometry.stamp_s) +
                                " s holds a value that is not finite");
  }
  try {
    recent_.push_back(recent_.empty() ? startAt(odometry) : moveOn(recent_.back(), odometry));
  } catch (const std::invalid_argument&) {
    ++counters_.odometry_rejected;
    throw;
  }
  ++counters_.odometry_messages;
  while (recent_.size() > 2 && recent_[1].odometry.stamp_s < odometry.stamp_s - kRecent_s) {
    recent_.pop_front();
  }
  takeInWaiting();
  releaseHeldBack();
}

ParticleFilter::Instant ParticleFilter::startAt(const Odometry& odometry) const {
  const Pose2 start = params_.start_pose.value_or(odometry.pose);
  Instant instant{odometry, start, {}};
  std::normal_distribution<double> normal;
  for (RandomStream& stream : streamsFor(StreamPurpose::kStart, params_)) {
    Pose2 pose = start;
    pose.x_m += params_.start_position_std_m * normal(stream);
    pose.y_m += params_.start_position_std_m * normal(stream);
    pose.yaw_rad = wrapAngle(pose.yaw_rad + params_.start_yaw_std_rad * normal(stream));
    instant.poses.push_back(pose);
    normal.reset();  // its spare value belongs to this particle's stream
  }
  return instant;
}

ParticleFilter::Instant ParticleFilter::moveOn(const Instant& from, const Odometry& odometry) {
  const MotionIncrement motion = motionBetween(from.odometry, odometry);
  Instant to{odometry, advance(from.dead_reckoning, motion), from.poses};
  for (std::size_t j = 0; j < to.poses.size(); ++j) {
    to.poses[j] = advanceNoisily(from.poses[j], motion, params_.motion, motion_streams_[j]);
  }
  return to;
}

// ---- pings: the log and the histories grow -------------------------------------------------

std::string ParticleFilter::addPing(Ping ping) {
  std::unique_lock lock(mutex_);
  if (!std::isfinite(ping.stamp_s)) {
    ++counters_.pings_rejected;
    return "ping's stamp is not finite";
  }
  if (!recent_.empty() && ping.stamp_s <= recent_.back().odometry.stamp_s) return takeIn(ping);
  if (finished_) {
    ++counters_.pings_dropped;
    return "ping of stamp " + std::to_string(ping.stamp_s) + " s came after the survey's end";
  }
  const double stamp_s = ping.stamp_s;
  waiting_.emplace(stamp_s, std::move(ping));
  if (waiting_.size() <= params_.ping_queue) return "";
  const double oldest_s = waiting_.begin()->first;
  waiting_.erase(waiting_.begin());
  ++counters_.pings_dropped;
  return "ping of stamp " + std::to_string(oldest_s) +
         " s dropped: " + std::to_string(params_.ping_queue) +
         " pings wait for odometry at or after their stamps";
}

void ParticleFilter::takeInWaiting() {
  const double now_s = recent_.back().odometry.stamp_s;
  while (!waiting_.empty() && waiting_.begin()->first <= now_s) {
    takeIn(waiting_.begin()->second);  // what is wrong with it is in the counters
    waiting_.erase(waiting_.begin());
  }
}

ParticleFilter::Instant ParticleFilter::instantAt(double stamp_s) const {
  const auto after = std::lower_bound(
      recent_.begin(), recent_.end(), stamp_s,
      [](const Instant& instant, double stamp) { return instant.odometry.stamp_s < stamp; });
  if (after->odometry.stamp_s == stamp_s) return *after;
  const Instant& a = *std::prev(after);
  const double share =
      (stamp_s - a.odometry.stamp_s) / (after->odometry.stamp_s - a.odometry.stamp_s);
  Instant between = a;
  between.odometry.stamp_s = stamp_s;
  between.odometry.attitude = interpolate(a.odometry.attitude, after->odometry.attitude, share);
  between.dead_reckoning = interpolate(a.dead_reckoning, after->dead_reckoning, share);
  for (std::size_t j = 0; j < between.poses.size(); ++j) {
    between.poses[j] = interpolate(a.poses[j], after->poses[j], share);
  }
  return between;
}

std::string ParticleFilter::takeIn(const Ping& ping) {
  if (ping.stamp_s < recent_.front().odometry.stamp_s) {
    ++counters_.pings_dropped;
    return "ping of stamp " + std::to_string(ping.stamp_s) +
           " s dropped: the odometry kept begins at " +
           std::to_string(recent_.front().odometry.stamp_s) + " s";
  }
  const Instant instant = instantAt(ping.stamp_s);
  const Attitude& attitude = instant.odometry.attitude;
  const Beams beams = goodBeams(ping, attitude, params_.pings);
  counters_.beams_rejected += static_cast<std::uint64_t>(ping.beams_m.cols() - beams.cols());
  if (beams.cols() == 0) {
    ++counters_.pings_rejected;
    return "ping of stamp " + std::to_string(ping.stamp_s) + " s: none of its " +
           std::to_string(ping.beams_m.cols()) + " beams is finite and within range";
  }
  const std::size_t index = records_.size();
  const bool held_out = isHeldOut(index);
  MbesLog& log = held_out ? held_out_ : log_;
  records_.push_back({ping.stamp_s, attitude, instant.dead_reckoning, log.size(),
                      static_cast<std::uint32_t>(beams.cols()), held_out});
  histories_.append(instant.poses);
  log.append(static_cast<std::uint32_t>(index), beams);
  releaseHeldBack();
  return "";
}

bool ParticleFilter::isHeldOut(std::size_t ping) const {
  // every (1/holdout)-th ping
  const double share = params_.holdout;
  return std::floor(static_cast<double>(ping + 1) * share) >
         std::floor(static_cast<double>(ping) * share);
}

void ParticleFilter::releaseHeldBack() {
  if (recent_.empty()) return;
  const double youngest_s = recent_.back().odometry.stamp_s - params_.hold_back_s;
  while (released_pings_ < records_.size() &&
         (finished_ || records_[released_pings_].stamp_s <= youngest_s)) {
    const PingRecord& record = records_[released_pings_++];
    if (!record.held_out) released_beams_ = record.first_beam + record.beams;
  }
}

void ParticleFilter::finish() {
  std::unique_lock lock(mutex_);
  finished_ = true;
  counters_.pings_dropped += waiting_.size();
  waiting_.clear();
  releaseHeldBack();
}

// ---- maps: minibatches, weights, resampling ------------------------------------------------

std::size_t ParticleFilter::drawMinibatch(std::size_t particle, std::size_t size,
                                          PlacedBeam* out) const {
  std::shared_lock lock(mutex_);
  if (released_beams_ == 0) return 0;
  const std::uint64_t call = minibatch_calls_.at(particle).fetch_add(1);
  const std::size_t stream_of = params_.common_random_numbers ? 0 : particle;
  rbpf_core::drawMinibatch(log_, released_beams_, histories_, particle, params_.origin,
                           makeStream(params_.seed, StreamPurpose::kMinibatch, stream_of, call),
                           size, out);
  return released_beams_;
}

void ParticleFilter::placeBlock(std::size_t particle, std::size_t first, std::size_t size,
                                PlacedBeam* out) const {
  std::shared_lock lock(mutex_);
  if (particle >= params_.particles) {
    throw std::out_of_range("particle " + std::to_string(particle) + ", expected below " +
                            std::to_string(params_.particles));
  }
  if (first > released_beams_ || size > released_beams_ - first) {
    throw std::out_of_range(std::to_string(size) + " beams from " + std::to_string(first) +
                            ", expected no more than the " + std::to_string(released_beams_) +
                            " released");
  }
  rbpf_core::placeBlock(log_, first, size, histories_, particle, params_.origin, out);
}

Eigen::ArrayXd ParticleFilter::logWeights() const {
  std::shared_lock lock(mutex_);
  return log_weights_;
}

void ParticleFilter::setLogWeights(const Eigen::ArrayXd& log_weights) {
  std::unique_lock lock(mutex_);
  if (log_weights.size() != log_weights_.size() || !log_weights.allFinite()) {
    throw std::invalid_argument("log weights: expected " + std::to_string(log_weights_.size()) +
                                " finite values, got " + std::to_string(log_weights.size()) +
                                (log_weights.allFinite() ? "" : ", some not finite"));
  }
  log_weights_ = log_weights;
}

void ParticleFilter::resample(const std::vector<std::uint32_t>& ancestors) {
  std::unique_lock lock(mutex_);
  histories_.resample(ancestors);  // checks them
  for (Instant& instant : recent_) {
    const std::vector<Pose2> before = instant.poses;
    for (std::size_t j = 0; j < ancestors.size(); ++j) instant.poses[j] = before[ancestors[j]];
  }
  log_weights_.setConstant(-std::log(static_cast<double>(ancestors.size())));
}

// ---- what is known -------------------------------------------------------------------------

Pose2 weightedMean(const std::vector<Pose2>& poses, const Eigen::ArrayXd& weights) {
  Pose2 mean;
  double cos_yaw = 0.0;
  double sin_yaw = 0.0;
  for (std::size_t j = 0; j < poses.size(); ++j) {
    const double w = weights(static_cast<Eigen::Index>(j));
    mean.x_m += w * poses[j].x_m;
    mean.y_m += w * poses[j].y_m;
    cos_yaw += w * std::cos(poses[j].yaw_rad);
    sin_yaw += w * std::sin(poses[j].yaw_rad);
  }
  mean.yaw_rad = std::atan2(sin_yaw, cos_yaw);
  return mean;
}

Eigen::Matrix3d weightedCovariance(const std::vector<Pose2>& poses, const Eigen::ArrayXd& weights,
                                   const Pose2& mean) {
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (std::size_t j = 0; j < poses.size(); ++j) {
    const Eigen::Vector3d deviation(poses[j].x_m - mean.x_m, poses[j].y_m - mean.y_m,
                                    wrapAngle(poses[j].yaw_rad - mean.yaw_rad));
    covariance += weights(static_cast<Eigen::Index>(j)) * deviation * deviation.transpose();
  }
  return covariance;
}

Estimate ParticleFilter::estimate() const {
  std::shared_lock lock(mutex_);
  if (recent_.empty()) return {};
  const Instant& now = recent_.back();
  const Eigen::ArrayXd weights = log_weights_.exp();
  Estimate estimate;
  estimate.stamp_s = now.odometry.stamp_s;
  estimate.attitude = now.odometry.attitude;
  estimate.mean = weightedMean(now.poses, weights);
  estimate.covariance = weightedCovariance(now.poses, weights, estimate.mean);
  estimate.odometry = now.odometry.pose;
  estimate.dead_reckoning = now.dead_reckoning;
  return estimate;
}

std::vector<Pose2> ParticleFilter::particles() const {
  std::shared_lock lock(mutex_);
  return recent_.empty() ? std::vector<Pose2>{} : recent_.back().poses;
}

Beams ParticleFilter::beamsOf(std::size_t ping) const {
  const PingRecord& record = records_[ping];
  const MbesLog& log = record.held_out ? held_out_ : log_;
  Beams beams(3, record.beams);
  for (std::uint32_t i = 0; i < record.beams; ++i) {
    const LoggedBeam& beam = log[record.first_beam + i];
    beams.col(i) << beam.x_m, beam.y_m, beam.z_m;
  }
  return beams;
}

std::optional<PlacedPing> ParticleFilter::latestPing() const {
  std::shared_lock lock(mutex_);
  if (records_.empty()) return std::nullopt;
  const std::size_t index = records_.size() - 1;
  PlacedPing ping{records_[index].stamp_s, static_cast<std::uint32_t>(index), beamsOf(index), {}};
  for (std::size_t j = 0; j < histories_.particles(); ++j) {
    ping.poses.push_back(histories_.at(j, index).pose());
  }
  return ping;
}

std::optional<double> ParticleFilter::latestPingStamp() const {
  std::shared_lock lock(mutex_);
  if (records_.empty()) return std::nullopt;
  return records_.back().stamp_s;
}

std::vector<SurveyPing> ParticleFilter::survey(std::size_t first, std::size_t count,
                                               std::size_t stride) const {
  std::shared_lock lock(mutex_);
  const Eigen::ArrayXd weights = log_weights_.exp();
  std::vector<SurveyPing> pings;
  for (std::size_t i = first; i < records_.size() && pings.size() < count; i += stride) {
    std::vector<Pose2> poses;
    for (std::size_t j = 0; j < histories_.particles(); ++j) {
      poses.push_back(histories_.at(j, i).pose());
    }
    const Pose2 mean = weightedMean(poses, weights);
    const Eigen::Matrix3d covariance = weightedCovariance(poses, weights, mean);
    pings.push_back({records_[i], mean, covariance.diagonal().head<2>().cwiseSqrt(), beamsOf(i)});
  }
  return pings;
}

std::size_t ParticleFilter::pings() const {
  std::shared_lock lock(mutex_);
  return records_.size();
}

std::size_t ParticleFilter::pingsWaiting() const {
  std::shared_lock lock(mutex_);
  return waiting_.size();
}

std::size_t ParticleFilter::beams() const {
  std::shared_lock lock(mutex_);
  return log_.size();
}

std::size_t ParticleFilter::beamsReleased() const {
  std::shared_lock lock(mutex_);
  return released_beams_;
}

std::size_t ParticleFilter::beamsHeldOut() const {
  std::shared_lock lock(mutex_);
  return held_out_.size();
}

Counters ParticleFilter::counters() const {
  std::shared_lock lock(mutex_);
  return counters_;
}

}  // namespace rbpf_core
