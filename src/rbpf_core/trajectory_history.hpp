// h_t: the particles' pasts, as vectors of pointers to shared segments (the paper's Fig. 2).
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
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

// Where a ping's pose stands in every particle's past: segment and place within it, in one number.
// Slots rise from ping to ping, with gaps where a resampling has closed a segment early.
using PoseSlot = std::uint32_t;

// A stretch of one particle's trajectory that its descendants share. Written once, from its front.
struct Segment {
  static constexpr std::size_t kPoses = 64;  // 1.5 kB: short enough to be closed half full

  std::array<HistoryPose, kPoses> poses;
};

// The pasts of all particles, between two resamplings: a pose is found in the same two steps,
// whatever their number. Poses below a slot that has been told of may be read by any thread while
// further ones are appended.
class Pasts {
 public:
  const HistoryPose& at(std::size_t particle, PoseSlot slot) const {
    const std::size_t segment = particle * capacity_ + slot / Segment::kPoses;
    return segments_[segment]->poses[slot % Segment::kPoses];
  }

  std::size_t particles() const { return particles_; }

 private:
  friend class TrajectoryHistories;

  Pasts(std::size_t particles, std::size_t capacity)
      : particles_(particles), capacity_(capacity), segments_(particles * capacity) {}
  std::shared_ptr<Segment>& segment(std::size_t particle, std::size_t number) {
    return segments_[particle * capacity_ + number];
  }

  const std::size_t particles_;
  const std::size_t capacity_;                      // segments that each particle can have
  std::vector<std::shared_ptr<Segment>> segments_;  // [J, capacity]
};

// One pose per particle and ping. A resampling copies pointers, never poses; segments that no
// particle points to are freed.
class TrajectoryHistories {
 public:
  explicit TrajectoryHistories(std::size_t particles);

  // The poses of all particles at the next ping, [J].
  PoseSlot append(const std::vector<Pose2>& poses);

  // Particle j goes on from the past of ancestors[j]. Throws std::invalid_argument unless there
  // are J ancestors, each below J.
  void resample(const std::vector<std::uint32_t>& ancestors) { succeed(heirs(ancestors, now())); }

  // The same in two steps. The first, and longer, may be taken while poses are appended to the
  // histories that it started from; the second brings in the segments begun since.
  struct Stand {
    std::shared_ptr<const Pasts> pasts;
    std::size_t segments;
  };
  struct Heirs {
    std::vector<std::uint32_t> ancestors;
    std::shared_ptr<Pasts> pasts;
    std::size_t segments;  // inherited so far
  };
  Stand now() const { return {pasts_, lengths_.size()}; }
  static Heirs heirs(const std::vector<std::uint32_t>& ancestors, const Stand& stand);
  void succeed(Heirs heirs);

  const HistoryPose& at(std::size_t particle, PoseSlot slot) const {
    return pasts_->at(particle, slot);
  }
  std::shared_ptr<const Pasts> pasts() const { return pasts_; }
  std::size_t particles() const { return pasts_->particles(); }

  // Poses kept in memory now: shared ones count once.
  std::size_t storedPoses() const;

 private:
  void openSegment();

  std::shared_ptr<Pasts> pasts_;
  std::vector<std::uint32_t> lengths_;  // of the segments, common to all particles
  bool closed_ = true;                  // nothing is appended to the last segment any more
};

}  // namespace rbpf_core
