// What the filter knows at one moment, for every thread but the one that feeds it.
#pragma once

#include <Eigen/Core>
#include <atomic>
#include <memory>
#include <optional>
#include <vector>

#include "rbpf_core/append_only.hpp"
#include "rbpf_core/filter_params.hpp"
#include "rbpf_core/fix.hpp"
#include "rbpf_core/known_error.hpp"
#include "rbpf_core/log_block.hpp"
#include "rbpf_core/mbes_log.hpp"
#include "rbpf_core/odometry_use.hpp"
#include "rbpf_core/past_correction.hpp"
#include "rbpf_core/refusal.hpp"
#include "rbpf_core/trajectory_history.hpp"

namespace rbpf_core {

// What is known of a ping, apart from the particles' poses and its beams.
struct PingRecord {
  double stamp_s;
  Attitude attitude;
  Pose2 dead_reckoning;
  // The online estimate: mean and covariance of x, y, yaw of the particles when the ping was taken
  // in, before anything that it or a later one has said of them.
  Pose2 online;
  Eigen::Matrix3d online_covariance;
  // Of its pose in every particle's trajectory.
  PoseSlot slot;
  // Its first beam's number in SurveyLog::training, or in held_out if it is held out.
  std::size_t first_beam;
  std::uint32_t beams;
  bool held_out;
};

struct Counters {
  std::uint64_t odometry_messages = 0;
  // Not finite, or not later than the one before.
  std::uint64_t odometry_rejected = 0;
  // No odometry for them, or the queue overflowed.
  std::uint64_t pings_dropped = 0;
  // No good beam.
  std::uint64_t pings_rejected = 0;
  std::uint64_t beams_rejected = 0;
};

// All particles and the vehicle at one stamp.
struct StampedParticles {
  using ConstPtr = std::shared_ptr<const StampedParticles>;

  Odometry odometry;
  Pose2 dead_reckoning;
  std::vector<Pose2> poses;  // [J]
};

// Estimate and spread of the particles at one stamp.
struct Estimate {
  double stamp_s = 0.0;
  Attitude attitude;
  // Weighted, yaw on the circle.
  Pose2 mean;
  // Of x, y, yaw.
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  // The odometry's own pose at that stamp.
  Pose2 odometry;
  Pose2 dead_reckoning;
};

// One ping of the finished or growing survey, with the weighted mean of the particles' histories.
struct SurveyPing {
  PingRecord record;
  Pose2 estimate;
  // Weighted spread of the particles' x, y, yaw.
  Eigen::Matrix3d covariance;
  Beams levelled_m;
};

// Every ping taken in, its beams, and every fix. Only grows: a snapshot says how far it may be
// read.
struct SurveyLog {
  AppendOnly<PingRecord, 4096> pings;
  // Beams that maps are trained on: the paper's D_t.
  MbesLog training;
  // Beams of the pings kept out of it, for evaluation.
  MbesLog held_out;
  // In the order in which they came.
  AppendOnly<FixRecord, 256> fixes;
};

// The filter as it was when the snapshot was taken. A copy of a few pointers and numbers: it stays
// as it is while the filter goes on, and reading it locks nothing. It may be kept for as long as
// its filter lives.
class FilterSnapshot {
 public:
  // Algorithm 1: see rbpf_core::drawMinibatch. Returns N, the beams that can be drawn; draws none
  // if it is 0. Every call for a particle draws anew.
  std::size_t drawMinibatch(std::size_t particle, std::size_t size, PlacedBeam* out) const;

  // See rbpf_core::logBlock. Throws std::out_of_range unless the particles exist and all beams up
  // to first + size have been released.
  LogBlock logBlock(const std::vector<std::uint32_t>& particles, std::size_t first,
                    std::size_t size) const;

  // Its covariance is the particles' spread, or what is known otherwise where that is larger.
  Estimate estimate() const;
  std::optional<Odometry> latestOdometry() const;
  std::vector<Pose2> particles() const;
  Eigen::ArrayXd logWeights() const { return *log_weights_; }  // [J], normalised

  std::optional<PlacedPing> latestPing() const;
  std::optional<double> latestPingStamp() const;  // s; copies no poses
  std::vector<SurveyPing> survey(std::size_t first, std::size_t count,
                                 std::size_t stride = 1) const;
  const PingRecord& record(std::size_t ping) const { return log_->pings[ping]; }

  // Fixes taken, those that came late where they came.
  std::size_t fixes() const { return fixes_; }
  const FixRecord& fix(std::size_t i) const { return log_->fixes[i]; }

  std::size_t pings() const { return pings_; }
  // Particles of the start from which all of today's descend; none before the first ping.
  std::size_t founders() const { return pings_ == 0 ? 0 : trajectories_->founders(); }
  std::size_t pingsWaiting() const { return pings_waiting_; }
  // Whether the survey is over.
  bool finished() const { return finished_; }
  // In the training log; and those of them that may be trained on now.
  std::size_t beams() const { return beams_; }
  std::size_t beamsReleased() const { return beams_released_; }
  std::size_t beamsHeldOut() const { return beams_held_out_; }
  Counters counters() const { return counters_; }
  // Everything that the filter has refused, also pings that waited in it; good for as long as the
  // snapshot.
  const RefusalCounts& refused() const { return *refused_; }
  const OdometryUse& odometryUse() const { return odometry_use_; }

  // Corrections of the past that the histories have gone through, and that maps are to follow.
  std::uint32_t past() const { return past_; }
  // What is taken off the odometry for the particles' motion.
  MotionBias bias() const { return bias_; }
  // Of the first odometry message, or of the one when an operator gave the start; where the vehicle
  // was then, and how uncertain that is, x and y alike. None before it.
  struct Start {
    double stamp_s;
    Pose2 pose;
    double position_std_m;
    double yaw_std_rad;
  };
  const std::optional<Start>& start() const { return start_; }
  // How often the particles have been drawn anew about a given pose, and its stamp, or that of the
  // last ping then if it is later: pings up to it are of the particles before.
  std::uint32_t redraws() const { return redraws_; }
  const std::optional<double>& redrawnStamp() const { return redrawn_s_; }
  // Weighted mean of the particles' histories at a ping, and their spread.
  struct Past {
    Pose2 mean;
    Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  };
  Past pastAt(std::size_t ping, const Eigen::ArrayXd& weights) const;
  // In the levelled body frame, as logged.
  Beams beamsOf(const PingRecord& record) const;

 private:
  friend class ParticleFilter;

  std::vector<Pose2> posesAt(PoseSlot slot) const;

  const FilterParams* params_ = nullptr;
  const SurveyLog* log_ = nullptr;
  std::vector<std::atomic<std::uint64_t>>* minibatch_calls_ = nullptr;  // [J]
  std::shared_ptr<const Trajectories> trajectories_;
  // Null before the first odometry.
  StampedParticles::ConstPtr particles_;
  std::shared_ptr<const Eigen::ArrayXd> log_weights_;
  std::size_t fixes_ = 0;
  std::size_t pings_ = 0;
  std::size_t pings_waiting_ = 0;
  std::size_t beams_ = 0;
  std::size_t beams_released_ = 0;
  std::size_t beams_held_out_ = 0;
  Counters counters_;
  std::shared_ptr<const RefusalCounts> refused_;
  OdometryUse odometry_use_;
  std::uint32_t past_ = 0;
  MotionBias bias_;
  std::optional<KnownError> known_error_;
  std::optional<Start> start_;
  std::uint32_t redraws_ = 0;
  std::optional<double> redrawn_s_;
  bool finished_ = false;
};

// Mean and spread of weighted poses; the yaw's mean is taken on the circle.
Pose2 weightedMean(const std::vector<Pose2>& poses, const Eigen::ArrayXd& weights);
Eigen::Matrix3d weightedCovariance(const std::vector<Pose2>& poses, const Eigen::ArrayXd& weights,
                                   const Pose2& mean);

// Of their mean: the particles' spread, or what is known otherwise where that is larger.
Eigen::Matrix3d covarianceOfEstimate(const StampedParticles& particles,
                                     const Eigen::ArrayXd& weights, const Pose2& mean,
                                     const std::optional<KnownError>& known_error,
                                     const MotionNoise& noise);

}  // namespace rbpf_core
