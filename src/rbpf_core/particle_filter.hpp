// The Rao-Blackwellized particle filter: odometry and pings in, particles with histories out.
// Every public member may be called from any thread.
#pragma once

#include <atomic>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "rbpf_core/fair_shared_mutex.hpp"
#include "rbpf_core/mbes_log.hpp"
#include "rbpf_core/minibatch.hpp"
#include "rbpf_core/motion_model.hpp"
#include "rbpf_core/ping_filter.hpp"
#include "rbpf_core/trajectory_history.hpp"

namespace rbpf_core {

struct FilterParams {
  std::size_t particles = 40;  // J
  std::uint64_t seed = 1;
  std::optional<Pose2> start_pose;  // in map; without one, the first odometry's own pose
  double start_position_std_m = 0.0;
  double start_yaw_std_rad = 0.0;
  MotionNoise motion;
  PingFilterParams pings;
  std::size_t ping_queue = 200;  // pings that may wait for odometry
  double hold_back_s =
      30.0;               // pings younger than this are not drawn into minibatches; 0: the paper's
  double holdout = 0.02;  // share of pings never drawn
  bool common_random_numbers = false;  // the k-th minibatches of all particles: the same beams
  Origin origin;                       // of minibatch coordinates
};

// What is known of a ping, apart from the particles' poses and its beams.
struct PingRecord {
  double stamp_s;
  Attitude attitude;
  Pose2 dead_reckoning;
  std::size_t first_beam;  // in the training log, or in the held-out log
  std::uint32_t beams;
  bool held_out;
};

struct Counters {
  std::uint64_t odometry_messages = 0;
  std::uint64_t odometry_rejected = 0;  // not finite, or not later than the one before
  std::uint64_t pings_dropped = 0;      // no odometry for them, or the queue overflowed
  std::uint64_t pings_rejected = 0;     // no good beam
  std::uint64_t beams_rejected = 0;
};

// Estimate and spread of the particles at one instant.
struct Estimate {
  double stamp_s = 0.0;
  Attitude attitude;
  Pose2 mean;                                            // weighted, yaw on the circle
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  // of x, y, yaw
  Pose2 odometry;                                        // the odometry's own pose at that stamp
  Pose2 dead_reckoning;
};

// A ping and where each particle saw it.
struct PlacedPing {
  double stamp_s = 0.0;
  std::uint32_t index = 0;
  Beams levelled_m;          // x, y in the levelled body frame, z in map
  std::vector<Pose2> poses;  // [J]
};

// One ping of the finished or growing survey, with the weighted mean of the particles' histories.
struct SurveyPing {
  PingRecord record;
  Pose2 estimate;
  Eigen::Vector2d std_m;  // weighted spread of the particles' x, y
  Beams levelled_m;
};

class ParticleFilter {
 public:
  explicit ParticleFilter(const FilterParams& params);

  // Moves every particle on and takes in the pings that waited for it. An odometry message that is
  // not finite or not later than the one before is refused by std::invalid_argument.
  void addOdometry(const Odometry& odometry);

  // Takes a ping in at once, or as soon as the odometry has passed its stamp. Returns what was
  // wrong, or an empty string.
  std::string addPing(Ping ping);

  // Algorithm 1: see drawMinibatch. Returns N, the beams that can be drawn now; draws none if it is
  // 0.
  std::size_t drawMinibatch(std::size_t particle, std::size_t size, PlacedBeam* out) const;

  // See placeBlock. Throws std::out_of_range unless the particle exists and all beams up to first +
  // size have been released.
  void placeBlock(std::size_t particle, std::size_t first, std::size_t size, PlacedBeam* out) const;

  Estimate estimate() const;
  std::vector<Pose2> particles() const;
  Eigen::ArrayXd logWeights() const;  // [J], normalised
  void setLogWeights(const Eigen::ArrayXd& log_weights);

  // Particles, their histories and recent poses go on from the ancestors'; weights become uniform.
  void resample(const std::vector<std::uint32_t>& ancestors);

  std::optional<PlacedPing> latestPing() const;
  std::optional<double> latestPingStamp() const;  // s; copies no poses
  std::vector<SurveyPing> survey(std::size_t first, std::size_t count,
                                 std::size_t stride = 1) const;

  // The survey is over: pings still waiting are dropped and counted, nothing is held back any
  // longer.
  void finish();

  std::size_t particleCount() const { return params_.particles; }
  std::size_t pings() const;
  std::size_t pingsWaiting() const;
  std::size_t beams() const;          // in the training log
  std::size_t beamsReleased() const;  // of those, the first ones, that maps are trained on now
  std::size_t beamsHeldOut() const;
  Counters counters() const;

 private:
  // All particles and the vehicle at one odometry message.
  struct Instant {
    Odometry odometry;
    Pose2 dead_reckoning;
    std::vector<Pose2> poses;  // [J]
  };

  // All of these expect the mutex to be held.
  Instant startAt(const Odometry& odometry) const;
  Instant moveOn(const Instant& from, const Odometry& odometry);
  Instant instantAt(double stamp_s) const;
  std::string takeIn(const Ping& ping);
  void takeInWaiting();
  void releaseHeldBack();
  bool isHeldOut(std::size_t ping) const;
  Beams beamsOf(std::size_t ping) const;

  const FilterParams params_;
  mutable FairSharedMutex mutex_;  // guards everything below
  std::vector<RandomStream> motion_streams_;
  std::deque<Instant> recent_;  // the last few seconds, for pings that come late
  std::multimap<double, Ping> waiting_;
  std::vector<PingRecord> records_;
  TrajectoryHistories histories_;
  MbesLog log_;
  MbesLog held_out_;
  std::size_t released_pings_ = 0;  // pings old enough to be drawn
  std::size_t released_beams_ = 0;
  bool finished_ = false;
  Eigen::ArrayXd log_weights_;
  Counters counters_;
  // one counter a particle: a minibatch's stream is a function of seed, call number and, unless
  // random numbers are common, particle
  mutable std::vector<std::atomic<std::uint64_t>> minibatch_calls_;
};

// Mean and spread of weighted poses; the yaw's mean is taken on the circle.
Pose2 weightedMean(const std::vector<Pose2>& poses, const Eigen::ArrayXd& weights);
Eigen::Matrix3d weightedCovariance(const std::vector<Pose2>& poses, const Eigen::ArrayXd& weights,
                                   const Pose2& mean);

}  // namespace rbpf_core
