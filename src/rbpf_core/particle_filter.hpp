// The Rao-Blackwellized particle filter: odometry and pings in, particles with histories out.
#pragma once

#include <atomic>
#include <deque>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "rbpf_core/change.hpp"
#include "rbpf_core/filter_params.hpp"
#include "rbpf_core/filter_snapshot.hpp"
#include "rbpf_core/past_correction.hpp"

namespace rbpf_core {

// One writer at a time changes the filter and then publishes a snapshot of it; readers see only
// published snapshots, and hold no lock while they work on one. So taking in a ping waits for no
// minibatch, prediction or publication, and of a resampling only for the exchange of pointers at
// its end.
//
// Every member may be called from any thread. All of them report what they refuse by an exception
// that names the value and what was expected: Refusal for an odometry message, a ping or a fix,
// which has then been counted, and the filter goes on as if it had not come; std::invalid_argument
// for any other argument.
class ParticleFilter {
 public:
  explicit ParticleFilter(const FilterParams& params);

  // From now on it is told of everything that changes the filter, in that order; null: nobody is.
  void observe(ChangeObserver* observer);

  // Moves every particle on and takes in the pings that waited for it. Refused: what is not finite
  // or not later than the message before.
  void addOdometry(const Odometry& odometry);

  // Takes a ping in at once, or as soon as the odometry has passed its stamp. Refused: a ping
  // without a good beam, from a time for which there is no odometry, or from within a long gap of
  // it. If too many wait for odometry, it is the oldest of them that is dropped and named.
  void addPing(Ping ping);

  // Takes a fix at once, or as soon as the odometry has passed its stamp; it is then to be weighed.
  // A pose that an operator gives before anything else is the start. Refused: what is not finite,
  // no covariance, from a time for which there is no odometry, and what contradicts the odometry,
  // unless an operator gives it.
  void addFix(const Fix& fix);

  // Fixes taken since the last call, with the particles as they were at their stamps. To be called
  // by the thread that resamples: particles keep their numbers in between.
  struct FixToWeigh {
    Fix fix;
    StampedParticles::ConstPtr particles;
  };
  std::vector<FixToWeigh> takeFixesToWeigh();

  // Draws the particles anew about a pose that an operator gives; `at`: where they were at its
  // stamp. They go on from there, weights become uniform, and histories stay as they are: the
  // smoother, which takes that fix too, has to say what it means for the past. By the same thread.
  void drawAnew(const Fix& given, const std::vector<Pose2>& at);

  // Pings of this stamp and later ones will yet be added: their odometry is kept, for two minutes
  // at most. Without a stamp it is kept for some seconds.
  void keepOdometrySince(std::optional<double> stamp_s);

  // Normalised, [J] finite values.
  void setLogWeights(const Eigen::ArrayXd& log_weights);

  // Particles, their histories and recent poses go on from the ancestors'; weights become uniform.
  // Refused: anything but J ancestors, each below J.
  void resample(const std::vector<std::uint32_t>& ancestors);

  // The past was another than it seemed: histories, recent poses and the particles are moved, and
  // the particles' motion is freed of the bias from now on. Dead reckoning and odometry stay as
  // they are. Refused: motions for more pings than the log has, what is not finite, and what was
  // found out before the particles were drawn anew.
  void correctPast(const PastCorrection& correction);

  // From now on the estimate's covariance is at least what follows from this.
  void setKnownError(const KnownError& error);

  // The survey is over: pings still waiting are dropped and counted, those that come are refused,
  // nothing is held back any longer.
  void finish();

  // A survey that is over, or not, is taken up again: pings are taken in.
  void goOn();

  FilterSnapshot snapshot() const;
  const FilterParams& params() const { return params_; }

 private:
  // Holds the writers' mutex, and publishes a new snapshot before it lets go of it.
  class WriterLock {
   public:
    explicit WriterLock(ParticleFilter* filter) : filter_(*filter), lock_(filter->writer_mutex_) {}
    ~WriterLock() { filter_.publishSnapshot(std::move(new_log_weights)); }

    // Null: as they are.
    std::shared_ptr<const Eigen::ArrayXd> new_log_weights;

   private:
    ParticleFilter& filter_;
    const std::lock_guard<std::mutex> lock_;
  };

  // All of these expect the writers' mutex to be held.
  template <typename T>
  void tell(const T& change) {
    if (observer_ != nullptr) observer_.load()->onChange(Change(change));
  }
  void expectUsable(const Odometry& odometry);
  void start(const Odometry& odometry);
  void startFrom(const Fix& given);
  // Draws whose call numbers differ have nothing in common.
  std::vector<Pose2> drawAbout(const Pose2& mean, const Eigen::Matrix2d& position_root_m,
                               double yaw_std_rad, std::uint64_t call) const;
  StampedParticles propagate(const StampedParticles& from, const Odometry& odometry);
  void expectPoseAt(double stamp_s, InputKind kind, const std::string& name);
  StampedParticles particlesAt(double stamp_s) const;
  std::deque<StampedParticles::ConstPtr>::const_iterator firstNotBefore(double stamp_s) const;
  void takeIn(const Ping& ping);
  void takeIn(const Fix& fix);
  void expectUsable(const Fix& fix, const std::string& name);
  void expectAgreement(const Fix& fix, const std::string& name, const StampedParticles& particles);
  Eigen::ArrayXd weights() const;
  void takeInWaiting();
  void releaseHeldBack();
  bool isHeldOut(std::size_t ping) const;
  // Counts them; to be thrown if somebody has just brought one.
  Refusal refuse(InputKind kind, Reason reason, const std::string& what, std::size_t messages = 1);
  void publishSnapshot(std::shared_ptr<const Eigen::ArrayXd> new_log_weights);

  // What resamplings and corrections have in common; expects resampling_mutex_ alone. Nearly all of
  // the work is done aside, on the state that is there now, while pings are taken in:
  //   prepare(state of the histories, pings in the log), returns what is to be committed,
  //   change(poses of recent particles, the same to be changed),
  //   commit(what was prepared, writers' lock), when only an exchange of pointers is left.
  template <typename Prepare, typename Change, typename Commit>
  void replacePast(const Prepare& prepare, const Change& change, const Commit& commit);
  // Expects no lock but resampling_mutex_: map nodes hear of what follows.
  void settle();
  // Throws std::invalid_argument if there are motions for more pings.
  std::vector<RigidMotion> motionsBySlot(const PastCorrection& correction, std::size_t pings) const;

  const FilterParams params_;

  // One resampling or correction at a time; taken before the writers'.
  std::mutex resampling_mutex_;

  // Also read where no lock is held: set before threads are there, and null after them.
  std::atomic<ChangeObserver*> observer_{nullptr};

  std::mutex writer_mutex_;  // guards what follows
  std::vector<RandomStream> motion_streams_;
  // Of the last few seconds, for pings that come late, or since the stamp that was asked for.
  std::deque<StampedParticles::ConstPtr> recent_;
  std::optional<double> keep_since_s_;
  // Pings by stamp, for which no odometry has come yet.
  std::multimap<double, Ping> waiting_;
  std::multimap<double, Fix> waiting_fixes_;
  std::vector<FixToWeigh> to_weigh_;
  SurveyLog log_;
  TrajectoryHistories histories_;
  // Corrections of the past committed, and what the last one has said of the odometry.
  std::uint32_t past_ = 0;
  MotionBias bias_;
  std::optional<KnownError> known_error_;
  std::optional<FilterSnapshot::Start> start_;
  // The start that an operator gives.
  std::optional<Fix> given_start_;
  std::uint32_t redraws_ = 0;
  std::optional<double> redrawn_s_;
  // Pings old enough to be drawn, and the beams of those in the training log.
  std::size_t released_pings_ = 0;
  std::size_t released_beams_ = 0;
  bool finished_ = false;
  Counters counters_;
  // Replaced when it changes: snapshots hold it.
  std::shared_ptr<const RefusalCounts> refused_ = std::make_shared<const RefusalCounts>();
  OdometryUse odometry_use_;

  // Minibatches drawn so far for each particle. A minibatch's stream is a function of the seed, of
  // this number and, unless random numbers are common, of the particle.
  std::vector<std::atomic<std::uint64_t>> minibatch_calls_;

  mutable std::mutex published_mutex_;  // held for the copy of a few pointers; taken last
  FilterSnapshot published_;
};

}  // namespace rbpf_core
