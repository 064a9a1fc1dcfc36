#include "rbpf_core/minibatch.hpp"

#include <algorithm>
#include <array>

namespace rbpf_core {

namespace {

// A hint; a no-op where the compiler has none.
void prefetch(const void* address) {
#if defined(__GNUC__)
  __builtin_prefetch(address);
#else
  (void)address;
#endif
}

}  // namespace

PlacedBeam place(const LoggedBeam& beam, const HistoryPose& pose, const Origin& origin) {
  const float east_m = pose.cos_yaw * beam.x_m - pose.sin_yaw * beam.y_m;
  const float north_m = pose.sin_yaw * beam.x_m + pose.cos_yaw * beam.y_m;
  return {static_cast<float>(pose.x_m - origin.x_m) + east_m,
          static_cast<float>(pose.y_m - origin.y_m) + north_m, beam.z_m};
}

void drawMinibatch(const MbesLog& log, std::size_t beams, const Trajectories& trajectories,
                   std::size_t particle, const Origin& origin, RandomStream stream,
                   std::size_t size, PlacedBeam* out) {
  // Random beams and their poses are in no cache. In three passes over a group of draws the
  // processor waits for the memory once a group, not once a beam.
  constexpr std::size_t kGroup = 64;
  std::array<const LoggedBeam*, kGroup> beam{};
  std::array<const HistoryPose*, kGroup> pose{};
  for (std::size_t first = 0; first < size; first += kGroup) {
    const std::size_t n = std::min(kGroup, size - first);
    for (std::size_t i = 0; i < n; ++i) {
      beam[i] = &log[stream.below(beams)];
      prefetch(beam[i]);
    }
    for (std::size_t i = 0; i < n; ++i) {
      pose[i] = &trajectories.at(particle, beam[i]->slot);
      prefetch(pose[i]);
    }
    for (std::size_t i = 0; i < n; ++i) out[first + i] = place(*beam[i], *pose[i], origin);
  }
}

}  // namespace rbpf_core
