// h_t: the particles' pasts, as vectors of pointers to shared, immutable segments (the paper's Fig.
// 2).
#pragma once

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

// One pose per particle and ping. The segment a ping falls into is the same for all particles
// and stands in one common vector, so that a lookup costs the same after any number of resamplings.
class TrajectoryHistories {
 public:
  explicit TrajectoryHistories(std::size_t particles);

  // The poses of all particles at the next ping, [J].
  void append(const std::vector<Pose2>& poses);

  // Particle j goes on from the past of ancestors[j]: pointers are copied, never poses.
  // Throws std::invalid_argument unless there are J ancestors, each below J.
  void resample(const std::vector<std::uint32_t>& ancestors);

  const HistoryPose& at(std::size_t particle, std::size_t ping) const {
    const std::uint32_t segment = segment_of_ping_[ping];
    const std::size_t within = ping - segment_start_[segment];
    const Past& past = pasts_[particle];
    return segment < past.closed.size() ? (*past.closed[segment])[within] : past.open[within];
  }

  std::size_t particles() const { return pasts_.size(); }
  std::size_t pings() const { return segment_of_ping_.size(); }

  // Poses kept in memory now: shared ones count once.
  std::size_t storedPoses() const;

 private:
  using Segment = std::vector<HistoryPose>;
  struct Past {
    std::vector<std::shared_ptr<const Segment>> closed;
    Segment open;  // since the last resampling
  };

  std::vector<Past> pasts_;
  std::vector<std::size_t> segment_start_{0};   // index of each segment's first ping
  std::vector<std::uint32_t> segment_of_ping_;  // common to all particles
};

}  // namespace rbpf_core
