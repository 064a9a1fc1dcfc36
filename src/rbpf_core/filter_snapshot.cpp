#include "rbpf_core/filter_snapshot.hpp"

#include <cmath>
#include <stdexcept>
#include <string>

namespace rbpf_core {

// ---- beams for the maps ----------------------------------------------------------------------

std::size_t FilterSnapshot::drawMinibatch(std::size_t particle, std::size_t size,
                                          PlacedBeam* out) const {
  if (beams_released_ == 0) return 0;
  const std::uint64_t call = minibatch_calls_->at(particle).fetch_add(1);
  const std::size_t stream_of = params_->common_random_numbers ? 0 : particle;
  rbpf_core::drawMinibatch(
      log_->training, beams_released_, *trajectories_, particle, params_->origin,
      makeStream(params_->seed, StreamPurpose::kMinibatch, stream_of, call), size, out);
  return beams_released_;
}

LogBlock FilterSnapshot::logBlock(const std::vector<std::uint32_t>& particles, std::size_t first,
                                  std::size_t size) const {
  for (const std::uint32_t particle : particles) {
    if (particle < params_->particles) continue;
    throw std::out_of_range("particle " + std::to_string(particle) + ", expected below " +
                            std::to_string(params_->particles));
  }
  if (first > beams_released_ || size > beams_released_ - first) {
    throw std::out_of_range(std::to_string(size) + " beams from " + std::to_string(first) +
                            ", expected no more than the " + std::to_string(beams_released_) +
                            " released");
  }
  return rbpf_core::logBlock(log_->training, first, size, *trajectories_, particles,
                             params_->origin);
}

// ---- where the particles are -----------------------------------------------------------------

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

Eigen::Matrix3d covarianceOfEstimate(const StampedParticles& particles,
                                     const Eigen::ArrayXd& weights, const Pose2& mean,
                                     const std::optional<KnownError>& known_error,
                                     const MotionNoise& noise) {
  const Eigen::Matrix3d spread = weightedCovariance(particles.poses, weights, mean);
  if (!known_error) return spread;
  return largerOf(spread, known_error->covarianceAt(particles.odometry.stamp_s, mean, noise));
}

Estimate FilterSnapshot::estimate() const {
  if (!particles_) return {};
  const Eigen::ArrayXd weights = log_weights_->exp();
  Estimate estimate;
  estimate.stamp_s = particles_->odometry.stamp_s;
  estimate.attitude = particles_->odometry.attitude;
  estimate.mean = weightedMean(particles_->poses, weights);
  estimate.covariance =
      covarianceOfEstimate(*particles_, weights, estimate.mean, known_error_, params_->motion);
  estimate.odometry = particles_->odometry.pose;
  estimate.dead_reckoning = particles_->dead_reckoning;
  return estimate;
}

std::optional<Odometry> FilterSnapshot::latestOdometry() const {
  if (!particles_) return std::nullopt;
  return particles_->odometry;
}

std::vector<Pose2> FilterSnapshot::particles() const {
  return particles_ ? particles_->poses : std::vector<Pose2>{};
}

// ---- pings -----------------------------------------------------------------------------------

std::vector<Pose2> FilterSnapshot::posesAt(PoseSlot slot) const {
  std::vector<Pose2> poses;
  for (std::size_t j = 0; j < trajectories_->particles(); ++j)
    poses.push_back(trajectories_->at(j, slot).pose());
  return poses;
}

FilterSnapshot::Past FilterSnapshot::pastAt(std::size_t ping, const Eigen::ArrayXd& weights) const {
  const PoseSlot slot = record(ping).slot;
  if (trajectories_->areShared(slot)) {
    return {trajectories_->at(0, slot).pose(), Eigen::Matrix3d::Zero()};
  }
  const std::vector<Pose2> poses = posesAt(slot);
  const Pose2 mean = weightedMean(poses, weights);
  return {mean, weightedCovariance(poses, weights, mean)};
}

Beams FilterSnapshot::beamsOf(const PingRecord& record) const {
  const MbesLog& log = record.held_out ? log_->held_out : log_->training;
  Beams beams(3, record.beams);
  for (std::uint32_t i = 0; i < record.beams; ++i) {
    const LoggedBeam& beam = log[record.first_beam + i];
    beams.col(i) << beam.x_m, beam.y_m, beam.z_m;
  }
  return beams;
}

std::optional<double> FilterSnapshot::latestPingStamp() const {
  if (pings_ == 0) return std::nullopt;
  return record(pings_ - 1).stamp_s;
}

std::optional<PlacedPing> FilterSnapshot::latestPing() const {
  if (pings_ == 0) return std::nullopt;
  const PingRecord& latest = record(pings_ - 1);
  return PlacedPing{latest.stamp_s, static_cast<std::uint32_t>(pings_ - 1), beamsOf(latest),
                    posesAt(latest.slot)};
}

std::vector<SurveyPing> FilterSnapshot::survey(std::size_t first, std::size_t count,
                                               std::size_t stride) const {
  const Eigen::ArrayXd weights = log_weights_->exp();
  std::vector<SurveyPing> pings;
  for (std::size_t i = first; i < pings_ && pings.size() < count; i += stride) {
    const PingRecord& ping = record(i);
    const auto [mean, spread] = pastAt(i, weights);
    pings.push_back({ping, mean, spread, beamsOf(ping)});
  }
  return pings;
}

}  // namespace rbpf_core
