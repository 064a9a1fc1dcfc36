// Loop-closure prompting (the paper's Algorithm 2): when one is due and every map is ready, the
// latest ping is predicted by every particle's map, the weights follow, and the particles are
// resampled.
#pragma once

#include <atomic>
#include <limits>
#include <mutex>
#include <string>

#include "rbpf_core/particle_filter.hpp"
#include "rbpf_node/map_nodes.hpp"

namespace rbpf_node {

struct LoopClosureStatistics {
  std::uint32_t prompts = 0;             // that changed the weights
  std::uint32_t prompts_vetoed = 0;      // no particle's map explained the ping
  std::uint32_t prompts_skipped = 0;     // maps not ready, too little overlap, a node missing
  std::uint32_t resamplings_failed = 0;  // rolled back
  MovedMaps moved;                       // fetched from another node
  double tempering = std::numeric_limits<double>::quiet_NaN();  // of the last prompt
  double overlap = std::numeric_limits<double>::quiet_NaN();    // of the last prompt
  // Wall time of the last one that changed the weights, and of the last that was committed.
  double prompt_s = std::numeric_limits<double>::quiet_NaN();
  double resampling_s = std::numeric_limits<double>::quiet_NaN();
  std::string message = "waiting for pings";
};

class LoopClosureLoop {
 public:
  LoopClosureLoop(rbpf_core::ParticleFilter& filter, const MapNodes& maps,
                  const Parameters& params);

  // Prompts if the latest ping is at least 1/rate younger than the last prompt's. Waits for the map
  // nodes, never for the filter. To be called from one thread, as often as you like.
  void promptIfDue();
  bool promptIsDue() const;  // by that thread too

  // What promptIfDue() does once it has decided to; by that thread, or in its place. The first
  // throws std::runtime_error that names a node which does not answer; the second rolls back.
  void prompt(const rbpf_core::PlacedPing& ping);
  void resample(const std::vector<std::uint32_t>& ancestors);

  std::uint32_t epoch() const { return epoch_; }   // resamplings committed
  bool resampling() const { return resampling_; }  // one is being carried out
  LoopClosureStatistics statistics() const;

 private:
  void resampleIfDepleted();
  void skip(const std::string& why);
  void say(const std::string& message);

  rbpf_core::ParticleFilter& filter_;
  const MapNodes& maps_;
  const Parameters params_;
  std::atomic<std::uint32_t> epoch_{0};
  std::atomic<bool> resampling_{false};
  double last_prompt_s_ = -std::numeric_limits<double>::infinity();
  mutable std::mutex mutex_;  // guards statistics_
  LoopClosureStatistics statistics_;
};

}  // namespace rbpf_node
