// The smoother beside a running filter: takes the log's pings, and says how the histories are to be
// corrected.
#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "rbpf_core/particle_filter.hpp"
#include "rbpf_core/smoothing/smoother.hpp"

namespace rbpf_core::smoothing {

// Defaults are those of config/default.yaml.
struct PastSmoothingParams {
  // Of survey, between two smoothings; 0: none.
  double period_s = 30.0;
  // A correction that moves no ping by more than this is not made, m.
  double min_change_m = 0.05;
  // Maps follow once the histories may have moved by more than this since they last did, m.
  double map_tolerance_m = 0.2;
  SmoothingParams smoothing;
};

// What the last smoothing has found.
struct SmoothedPast {
  std::vector<Closure> closures;
  std::size_t accepted = 0;
  // In the graph.
  std::size_t fixes = 0;
  // Of the graph's nodes.
  std::vector<Pose2> nodes;
  // Of the log's pings, x, y, yaw in map; empty before the survey's end.
  std::vector<Eigen::Matrix3d> covariances;
  // What the last correction moved the ping by that it moved most, m; and the processor's time that
  // smoothing has taken so far, s.
  double largest_change_m = 0.0;
  double processor_s = 0.0;
};

class PastSmoothing {
 public:
  // The motion noise and the start's deviations are the filter's.
  PastSmoothing(const ParticleFilter& filter, const PastSmoothingParams& params);

  // Whether pings or fixes have come for another period.
  bool isDue() const;
  // A period begins anew with the latest ping.
  void putOff();

  // What the filter is to be told.
  struct News {
    // If it is worth it; it holds as long as nobody else corrects the past.
    std::optional<PastCorrection> correction;
    // Of the youngest ping, after the correction.
    std::optional<KnownError> known_error;
  };
  // Takes in what has come and works on it; the filter goes on meanwhile. By one thread at a time.
  News smooth() { return smooth(false); }
  // The same once the survey is over: every window is registered once more.
  News finish() { return smooth(true); }

  // From any thread.
  std::shared_ptr<const SmoothedPast> result() const;

 private:
  News smooth(bool is_over);
  void takePings(const FilterSnapshot& snapshot);
  void takeFixes(const FilterSnapshot& snapshot, bool is_over);
  std::optional<PastCorrection> correction(const FilterSnapshot& snapshot, bool is_over,
                                           SmoothedPast* result);

  const ParticleFilter& filter_;
  const PastSmoothingParams params_;
  // From the first ping on.
  std::unique_ptr<Smoother> smoother_;
  // Pings of the log taken so far, and for each of them the ping of the smoother's that stands for
  // it: pings that come late, after younger ones, move with those.
  std::size_t taken_ = 0;
  std::vector<std::size_t> stands_for_;
  // Fixes of the log looked at so far, and those that wait for the pings about them.
  std::size_t fixes_seen_ = 0;
  std::vector<FixRecord> waiting_fixes_;
  // By how much histories may have moved since maps last followed, m.
  double not_followed_m_ = 0.0;
  // Of the particles, at the last smoothing.
  std::uint32_t redraws_ = 0;

  mutable std::mutex mutex_;  // guards what follows
  double last_s_;
  std::shared_ptr<const SmoothedPast> result_ = std::make_shared<const SmoothedPast>();
};

}  // namespace rbpf_core::smoothing
