// What ParticleFilter does with absolute fixes: the log grows, and they wait to be weighed.
#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <random>
#include <utility>

#include "rbpf_core/decimal.hpp"
#include "rbpf_core/particle_filter.hpp"
#include "rbpf_core/rigid.hpp"

namespace rbpf_core {

namespace {

// Fixes that may wait for odometry, and the latest ones with which another is compared.
constexpr std::size_t kFixQueue = 1000;
constexpr std::size_t kFixesCompared = 64;
// From map's origin. No projection of the earth has coordinates so large: Web Mercator's reach to
// 2.0e7 m.
constexpr double kFurthest_m = 3e7;

// Of one that an operator gives.
Pose2 poseOf(const Fix& given) {
  return {given.position_m.x(), given.position_m.y(), given.heading->yaw_rad};
}

std::string nameOf(const Fix& fix) { return "fix of stamp " + decimal(fix.stamp_s, 3) + " s"; }

}  // namespace

void ParticleFilter::addFix(const Fix& fix) {
  const WriterLock lock(this);
  tell(fix);
  const std::string name = nameOf(fix);
  expectUsable(fix, name);
  if (finished_) {
    throw refuse(InputKind::kFix, Reason::kSurveyOver, name + " came after the survey's end");
  }
  if (fix.heading && log_.pings.size() == 0 && log_.fixes.size() == 0) return startFrom(fix);
  if (!recent_.empty() && fix.stamp_s <= recent_.back()->odometry.stamp_s) return takeIn(fix);
  waiting_fixes_.emplace(fix.stamp_s, fix);
  if (waiting_fixes_.size() <= kFixQueue) return;
  const std::string oldest = nameOf(waiting_fixes_.begin()->second);
  waiting_fixes_.erase(waiting_fixes_.begin());
  throw refuse(InputKind::kFix, Reason::kQueueFull,
               oldest + " dropped: " + std::to_string(kFixQueue) +
                   " fixes wait for odometry at or after their stamps");
}

void ParticleFilter::expectUsable(const Fix& fix, const std::string& name) {
  if (!std::isfinite(fix.stamp_s) || !fix.position_m.allFinite() ||
      !fix.covariance_m2.allFinite() ||
      (fix.heading && !std::isfinite(fix.heading->yaw_rad + fix.heading->variance_rad2))) {
    throw refuse(InputKind::kFix, Reason::kNotFinite, name + " holds a value that is not finite");
  }
  const double largest_m = fix.position_m.cwiseAbs().maxCoeff();
  if (largest_m > kFurthest_m) {
    throw refuse(InputKind::kFix, Reason::kImplausiblePose,
                 name + " lies at (" + decimal(fix.position_m.x(), 1) + ", " +
                     decimal(fix.position_m.y(), 1) + ") m, expected within +-" +
                     decimal(kFurthest_m, 0) + " m. Is it in metres?");
  }
  const Eigen::Matrix2d& R = fix.covariance_m2;
  const double largest_std_m = std::sqrt(std::max(R(0, 0), R(1, 1)));
  if (!R.isApprox(R.transpose()) || R.llt().info() != Eigen::Success ||
      !(largest_std_m <= params_.fixes.max_std_m)) {
    throw refuse(InputKind::kFix, Reason::kMalformed,
                 name + " has the covariance ((" + decimal(R(0, 0), 3) + ", " +
                     decimal(R(0, 1), 3) + "), (" + decimal(R(1, 0), 3) + ", " +
                     decimal(R(1, 1), 3) +
                     ")) m^2, expected a positive definite one of standard deviations up to " +
                     decimal(params_.fixes.max_std_m, 0) + " m");
  }
  if (fix.heading && !(fix.heading->variance_rad2 > 0.0)) {
    throw refuse(InputKind::kFix, Reason::kMalformed,
                 name + " has a heading of variance " + decimal(fix.heading->variance_rad2, 6) +
                     " rad^2, expected above 0");
  }
}

void ParticleFilter::takeIn(const Fix& fix) {
  const std::string name = nameOf(fix);
  expectPoseAt(fix.stamp_s, InputKind::kFix, name);
  const std::size_t fixes = log_.fixes.size();
  for (std::size_t i = fixes - std::min(fixes, kFixesCompared); i < fixes; ++i) {
    const Fix& other = log_.fixes[i].fix;
    if (other.stamp_s != fix.stamp_s || other.position_m != fix.position_m) continue;
    throw refuse(InputKind::kFix, Reason::kDuplicateStamp,
                 name + " has come before. Is it published or recorded twice?");
  }
  auto particles = std::make_shared<const StampedParticles>(particlesAt(fix.stamp_s));
  if (!fix.heading) expectAgreement(fix, name, *particles);
  log_.fixes.push_back({fix, particles->dead_reckoning});
  to_weigh_.push_back({fix, std::move(particles)});
}

// The estimate's own covariance is not trusted alone: particles that are wrong all alike, or a
// wrong heading at the start, would refuse every fix. The longer there has been none, the more
// room.
void ParticleFilter::expectAgreement(const Fix& fix, const std::string& name,
                                     const StampedParticles& particles) {
  const Eigen::ArrayXd w = weights();
  const Pose2 mean = weightedMean(particles.poses, w);
  const std::optional<double> last_fix_s = known_error_ ? known_error_->last_fix_s : std::nullopt;
  const double alone_s = std::max(fix.stamp_s - last_fix_s.value_or(start_->stamp_s), 0.0);
  const double drift_m = params_.fixes.drift_mps * alone_s;
  const Eigen::Matrix2d expected =
      covarianceOfEstimate(particles, w, mean, known_error_, params_.motion).topLeftCorner<2, 2>() +
      fix.covariance_m2 + drift_m * drift_m * Eigen::Matrix2d::Identity();
  const Eigen::Vector2d off_m = fix.position_m - Eigen::Vector2d(mean.x_m, mean.y_m);
  const double sigmas = sigmasOf(off_m, expected);
  if (sigmas <= params_.fixes.max_sigmas) return;
  throw refuse(InputKind::kFix, Reason::kContradicts,
               name + " lies " + decimal(off_m.norm(), 1) + " m from the estimate, " +
                   decimal(sigmas, 1) + " standard deviations of both, expected at most " +
                   decimal(params_.fixes.max_sigmas, 1) +
                   ". An outlier, another origin, or a start or heading that is not the true one?");
}

// ---- where the particles start ----------------------------------------------------------------

void ParticleFilter::start(const Odometry& odometry) {
  Pose2 pose = params_.start_pose.value_or(odometry.pose);
  Eigen::Matrix2d root_m = params_.start_position_std_m * Eigen::Matrix2d::Identity();
  double position_std_m = params_.start_position_std_m;
  double yaw_std_rad = params_.start_yaw_std_rad;
  if (given_start_) {
    pose = poseOf(*given_start_);
    const Eigen::Matrix2d& R = given_start_->covariance_m2;
    root_m = R.llt().matrixL();
    position_std_m = std::sqrt(0.5 * R.trace());
    yaw_std_rad = std::sqrt(given_start_->heading->variance_rad2);
  }
  start_ = {odometry.stamp_s, pose, position_std_m, yaw_std_rad};
  const StampedParticles particles{odometry, pose, drawAbout(pose, root_m, yaw_std_rad, 0)};
  recent_ = {std::make_shared<const StampedParticles>(particles)};
}

void ParticleFilter::startFrom(const Fix& given) {
  given_start_ = given;
  if (!recent_.empty()) start(recent_.back()->odometry);
}

std::vector<Pose2> ParticleFilter::drawAbout(const Pose2& mean,
                                             const Eigen::Matrix2d& position_root_m,
                                             double yaw_std_rad, std::uint64_t call) const {
  std::vector<Pose2> drawn;
  for (std::size_t j = 0; j < params_.particles; ++j) {
    RandomStream stream = makeStream(params_.seed, StreamPurpose::kStart, j, call);
    std::normal_distribution<double> normal;
    const double first = normal(stream);
    const double second = normal(stream);
    const Eigen::Vector2d off_m = position_root_m * Eigen::Vector2d(first, second);
    drawn.push_back({mean.x_m + off_m.x(), mean.y_m + off_m.y(),
                     wrapAngle(mean.yaw_rad + yaw_std_rad * normal(stream))});
  }
  return drawn;
}

void ParticleFilter::drawAnew(const Fix& given, const std::vector<Pose2>& at) {
  const std::lock_guard one_at_a_time(resampling_mutex_);
  WriterLock lock(this);
  tell(DrawnAnew{given, at});
  const Eigen::Matrix2d root_m = given.covariance_m2.llt().matrixL();
  std::vector<Pose2> motions =
      drawAbout(poseOf(given), root_m, std::sqrt(given.heading->variance_rad2), ++redraws_);
  for (std::size_t j = 0; j < motions.size(); ++j) motions[j] = compose(motions[j], inverse(at[j]));
  // Pings of its stamp and later ones may have been taken in before it came.
  const std::size_t pings = log_.pings.size();
  redrawn_s_ = std::max(given.stamp_s, pings > 0 ? log_.pings[pings - 1].stamp_s : given.stamp_s);
  const auto moved = [&](const StampedParticles& before) {
    StampedParticles after = before;
    for (std::size_t j = 0; j < motions.size(); ++j)
      after.poses[j] = move(motions[j], before.poses[j]);
    return std::make_shared<const StampedParticles>(std::move(after));
  };
  for (StampedParticles::ConstPtr& particles : recent_) {
    if (particles->odometry.stamp_s >= given.stamp_s) particles = moved(*particles);
  }
  for (FixToWeigh& fix : to_weigh_) {
    if (fix.fix.stamp_s >= given.stamp_s) fix.particles = moved(*fix.particles);
  }
  const auto J = static_cast<double>(params_.particles);
  lock.new_log_weights = std::make_shared<const Eigen::ArrayXd>(
      Eigen::ArrayXd::Constant(static_cast<Eigen::Index>(params_.particles), -std::log(J)));
}

// ---- what is weighed ---------------------------------------------------------------------------

std::vector<ParticleFilter::FixToWeigh> ParticleFilter::takeFixesToWeigh() {
  const std::lock_guard lock(writer_mutex_);
  if (!to_weigh_.empty()) tell(FixesTaken{});
  return std::exchange(to_weigh_, {});
}

}  // namespace rbpf_core
