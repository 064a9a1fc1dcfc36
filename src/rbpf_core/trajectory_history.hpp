// h_t: the particles' trajectories, as vectors of pointers to shared segments (the paper's Fig. 2).
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <set>
#include <vector>

#include "rbpf_core/types.hpp"

namespace rbpf_core {

// A pose ready to place beams: 24 bytes, no trigonometry left.
struct HistoryPose {
  double x_m, y_m;
  float cos_yaw, sin_yaw;

  static HistoryPose of(const Pose2& pose) {
    return {pose.x_m, pose.y_m, static_cast<float>(std::cos(pose.yaw_rad)),
            static_cast<float>(std::sin(pose.yaw_rad))};
  }
  Pose2 pose() const { return {x_m, y_m, std::atan2(sin_yaw, cos_yaw)}; }
};

// A motion of the map frame, which takes a pose h to C h: no trigonometry left.
struct RigidMotion {
  double x_m = 0.0, y_m = 0.0;
  double cos_yaw = 1.0, sin_yaw = 0.0;

  static RigidMotion of(const Pose2& pose) {
    return {pose.x_m, pose.y_m, std::cos(pose.yaw_rad), std::sin(pose.yaw_rad)};
  }
};

inline HistoryPose move(const RigidMotion& rigid, const HistoryPose& pose) {
  const double c = rigid.cos_yaw;
  const double s = rigid.sin_yaw;
  return {rigid.x_m + c * pose.x_m - s * pose.y_m, rigid.y_m + s * pose.x_m + c * pose.y_m,
          static_cast<float>(c * pose.cos_yaw - s * pose.sin_yaw),
          static_cast<float>(s * pose.cos_yaw + c * pose.sin_yaw)};
}

// Where a ping's pose is in every particle's trajectory: the segment's number and the place within
// it, in one integer. Slots rise from ping to ping, with gaps where a resampling has closed a
// segment before it was full.
using PoseSlot = std::uint32_t;

// A stretch of one particle's trajectory, shared by all of its descendants. Poses are written once,
// from the front: a correction writes new segments.
struct Segment {
  // 1.5 kB: short enough to be closed half full
  static constexpr std::size_t kPoses = 64;

  std::array<HistoryPose, kPoses> poses;
};

// The trajectories of all particles from the first ping on, as they are between two resamplings or
// corrections. A pose is found in two look-ups, however many resamplings there have been. One
// writer appends poses through TrajectoryHistories; meanwhile any thread may read the poses of
// every slot that the writer has already published.
class Trajectories {
 public:
  const HistoryPose& at(std::size_t particle, PoseSlot slot) const {
    const std::size_t segment = particle * capacity_ + slot / Segment::kPoses;
    return segments_[segment]->poses[slot % Segment::kPoses];
  }

  // Whether all particles have the same segment there: a resampling's last common ancestor.
  bool areShared(PoseSlot slot) const {
    const std::size_t number = slot / Segment::kPoses;
    for (std::size_t j = 1; j < particles_; ++j) {
      if (segments_[j * capacity_ + number] != segments_[number]) return false;
    }
    return true;
  }

  // Of how many different histories the first poses are: the particles of the survey's start from
  // which all of today's descend. Expects a pose.
  std::size_t founders() const {
    std::set<const Segment*> first;
    for (std::size_t j = 0; j < particles_; ++j) first.insert(segments_[j * capacity_].get());
    return first.size();
  }

  std::size_t particles() const { return particles_; }

 private:
  friend class TrajectoryHistories;

  Trajectories(std::size_t particles, std::size_t capacity)
      : particles_(particles), capacity_(capacity), segments_(particles * capacity) {}
  std::shared_ptr<Segment>& segment(std::size_t particle, std::size_t number) {
    return segments_[particle * capacity_ + number];
  }

  const std::size_t particles_;
  // Segments that each particle has room for.
  const std::size_t capacity_;
  std::vector<std::shared_ptr<Segment>> segments_;  // [J, capacity]
};

// Grows the trajectories by one pose per particle and ping, resamples and corrects them. A
// resampling copies pointers, never poses; a correction moves each pose once, however many
// particles share it; segments that nobody points to are freed.
class TrajectoryHistories {
 public:
  explicit TrajectoryHistories(std::size_t particles);

  // The poses of all particles at the next ping, [J].
  PoseSlot append(const std::vector<Pose2>& poses);

  // Particle j goes on from the trajectory of ancestors[j]. Throws std::invalid_argument unless
  // there are J ancestors, each below J.
  void resample(const std::vector<std::uint32_t>& ancestors) {
    commitResampling(prepareResampling(ancestors, state()));
  }

  // The same in two steps, for a writer that must not be kept waiting: prepareResampling does most
  // of the work and touches nothing but the state that it is given, so that poses may be appended
  // in the meantime; commitResampling is short and brings in the segments begun since.
  struct State {
    std::shared_ptr<const Trajectories> trajectories;
    std::size_t segments;
    // Poses in the last segment, which may yet grow.
    std::uint32_t last_length;
  };
  struct PreparedResampling {
    std::vector<std::uint32_t> ancestors;
    std::shared_ptr<Trajectories> trajectories;
    // Of each particle, copied from its ancestor so far.
    std::size_t segments;
  };
  State state() const {
    return {trajectories_, lengths_.size(), lengths_.empty() ? 0 : lengths_.back()};
  }
  static PreparedResampling prepareResampling(const std::vector<std::uint32_t>& ancestors,
                                              const State& state);
  void commitResampling(PreparedResampling prepared);

  // Every pose of every particle is moved: that at slot s by of_slot[s], those beyond its end by
  // of_rest. In the same two steps; there must be no resampling between them.
  struct PreparedCorrection {
    RigidMotion of_rest;
    // Moved so far, as State has them.
    std::shared_ptr<Trajectories> trajectories;
    std::size_t segments;
    std::uint32_t last_length;
  };
  static PreparedCorrection prepareCorrection(const std::vector<RigidMotion>& of_slot,
                                              const RigidMotion& of_rest, const State& state);
  void commitCorrection(PreparedCorrection prepared);

  const HistoryPose& at(std::size_t particle, PoseSlot slot) const {
    return trajectories_->at(particle, slot);
  }
  std::shared_ptr<const Trajectories> trajectories() const { return trajectories_; }
  std::size_t particles() const { return trajectories_->particles(); }

  // Poses kept in memory now: shared ones count once.
  std::size_t storedPoses() const;

 private:
  void openSegment();
  static std::shared_ptr<Trajectories> withCapacity(const Trajectories& before,
                                                    std::size_t capacity);

  std::shared_ptr<Trajectories> trajectories_;
  // Poses in each segment, common to all particles.
  std::vector<std::uint32_t> lengths_;
  // Nothing is appended to the last segment any more.
  bool closed_ = true;
};

}  // namespace rbpf_core
