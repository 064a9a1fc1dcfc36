// What ParticleFilter does with absolute fixes: the log grows, and they wait to be weighed.
#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <utility>

#include "rbpf_core/decimal.hpp"
#include "rbpf_core/particle_filter.hpp"

namespace rbpf_core {

namespace {

// Fixes that may wait for odometry, and the latest ones with which another is compared.
constexpr std::size_t kFixQueue = 1000;
constexpr std::size_t kFixesCompared = 64;

std::string nameOf(const Fix& fix) { return "fix of stamp " + decimal(fix.stamp_s, 3) + " s"; }

}  // namespace

void ParticleFilter::addFix(const Fix& fix) {
  const WriterLock lock(this);
  tell(fix);
  const std::string name = nameOf(fix);
  expectUsable(fix, name);
  if (!recent_.empty() && fix.stamp_s <= recent_.back()->odometry.stamp_s) return takeIn(fix);
  if (finished_) {
    throw refuse(InputKind::kFix, Reason::kSurveyOver, name + " came after the survey's end");
  }
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
      !fix.covariance_m2.allFinite()) {
    throw refuse(InputKind::kFix, Reason::kNotFinite, name + " holds a value that is not finite");
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
  expectAgreement(fix, name, *particles);
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

std::vector<ParticleFilter::FixToWeigh> ParticleFilter::takeFixesToWeigh() {
  const std::lock_guard lock(writer_mutex_);
  if (!to_weigh_.empty()) tell(FixesTaken{});
  return std::exchange(to_weigh_, {});
}

}  // namespace rbpf_core
