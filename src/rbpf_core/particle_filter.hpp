// The Rao-Blackwellized particle filter: odometry and pings in, particles with histories out.
// Every public member may be called from any thread.
#pragma once

#include <atomic>
#include <deque>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "rbpf_core/filter_params.hpp"
#include "rbpf_core/filter_snapshot.hpp"

namespace rbpf_core {

// Whoever feeds the filter writes beside what others read, and then shows it to them all at once:
// readers work on snapshots and hold no lock while they do. Taking in a ping therefore waits for
// no minibatch, prediction or publication, and of a resampling only for the exchange of pointers
// at its end.
class ParticleFilter {
 public:
  explicit ParticleFilter(const FilterParams& params);

  // Moves every particle on and takes in the pings that waited for it. An odometry message that is
  // not finite or not later than the one before is refused by std::invalid_argument.
  void addOdometry(const Odometry& odometry);

  // Takes a ping in at once, or as soon as the odometry has passed its stamp. Returns what was
  // wrong, or an empty string.
  std::string addPing(Ping ping);

  // Normalised, [J]; whatever else is refused by std::invalid_argument.
  void setLogWeights(const Eigen::ArrayXd& log_weights);

  // Particles, their histories and recent poses go on from the ancestors'; weights become uniform.
  void resample(const std::vector<std::uint32_t>& ancestors);

  // The survey is over: pings still waiting are dropped and counted, nothing is held back any
  // longer.
  void finish();

  FilterSnapshot snapshot() const;

  // Each of these is a look at a snapshot of its own.
  std::size_t drawMinibatch(std::size_t particle, std::size_t size, PlacedBeam* out) const {
    return snapshot().drawMinibatch(particle, size, out);
  }
  void placeBlock(std::size_t particle, std::size_t first, std::size_t size,
                  PlacedBeam* out) const {
    snapshot().placeBlock(particle, first, size, out);
  }
  Estimate estimate() const { return snapshot().estimate(); }
  std::vector<Pose2> particles() const { return snapshot().particles(); }
  Eigen::ArrayXd logWeights() const { return snapshot().logWeights(); }
  std::optional<PlacedPing> latestPing() const { return snapshot().latestPing(); }
  std::optional<double> latestPingStamp() const { return snapshot().latestPingStamp(); }
  std::vector<SurveyPing> survey(std::size_t first, std::size_t count,
                                 std::size_t stride = 1) const {
    return snapshot().survey(first, count, stride);
  }
  std::size_t particleCount() const { return params_.particles; }
  std::size_t pings() const { return snapshot().pings(); }
  std::size_t pingsWaiting() const { return snapshot().pingsWaiting(); }
  std::size_t beams() const { return snapshot().beams(); }
  std::size_t beamsReleased() const { return snapshot().beamsReleased(); }
  std::size_t beamsHeldOut() const { return snapshot().beamsHeldOut(); }
  Counters counters() const { return snapshot().counters(); }

 private:
  using InstantPtr = std::shared_ptr<const Instant>;

  // Holds the writer's mutex, and in the end shows what has become of the filter.
  class Writing {
   public:
    explicit Writing(ParticleFilter* filter) : filter_(*filter), lock_(filter->writer_) {}
    ~Writing() { filter_.show(std::move(new_log_weights)); }

    std::shared_ptr<const Eigen::ArrayXd> new_log_weights;  // null: as they are

   private:
    ParticleFilter& filter_;
    const std::lock_guard<std::mutex> lock_;
  };

  // All of these expect the writer's mutex to be held.
  Instant startAt(const Odometry& odometry) const;
  Instant moveOn(const Instant& from, const Odometry& odometry);
  Instant instantAt(double stamp_s) const;
  std::string takeIn(const Ping& ping);
  void takeInWaiting();
  void releaseHeldBack();
  bool isHeldOut(std::size_t ping) const;
  void show(std::shared_ptr<const Eigen::ArrayXd> new_log_weights);

  const FilterParams params_;

  std::mutex resampling_;  // one resampling at a time; taken before the writer's

  std::mutex writer_;  // guards what follows
  std::vector<RandomStream> motion_streams_;
  std::deque<InstantPtr> recent_;  // the last few seconds, for pings that come late
  std::multimap<double, Ping> waiting_;
  SurveyBooks books_;
  TrajectoryHistories histories_;
  std::size_t released_pings_ = 0;  // pings old enough to be drawn
  std::size_t released_beams_ = 0;
  bool finished_ = false;
  Counters counters_;

  // one counter a particle: a minibatch's stream is a function of seed, call number and, unless
  // random numbers are common, particle
  std::vector<std::atomic<std::uint64_t>> minibatch_calls_;

  mutable std::mutex shown_mutex_;  // held for the copy of a few pointers; taken last
  FilterSnapshot shown_;
};

}  // namespace rbpf_core
