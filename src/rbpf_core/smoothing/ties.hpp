// What a window that lies on an older one's map tells about the single nodes of both: the odometry
// bends either window, which a pose of the whole knows nothing of.
#pragma once

#include <cstddef>
#include <vector>

#include "rbpf_core/smoothing/local_map.hpp"
#include "rbpf_core/smoothing/registration.hpp"
#include "rbpf_core/smoothing/track.hpp"

namespace rbpf_core::smoothing {

// Of a node in the frame of an older one.
struct Tie {
  std::size_t older = 0;
  std::size_t newer = 0;
  UncertainPose relative;
};

// Ties side by side share errors, of one map and of the relief below its grid: together they know
// so much of what they would if each erred on its own.
constexpr double kShareOfTies = 0.25;

// Windows about nodes k and j of a track, which lie as `poses` [nodes] say within each window.
struct LaidWindow {
  const Track& track;
  const std::vector<Pose2>& poses;
  std::size_t k, j;
  Track::Range around_k;
  // Of the older window, in node k's frame.
  const LocalMap& map;
  // How j's window lies on it.
  const Registration& registration;
  // Of a window as a whole, as in RegistrationParams.
  double effective_beams;
};

// The beams of each of the younger nodes, by the older node whose swath they lie in: every such
// pair is one Gauss-Newton step from where the window as a whole lies. A pair knows x, y and yaw
// only as far as its few beams do: its covariance may be long.
std::vector<Tie> tiesOf(const LaidWindow& laid, const Track::Range& younger);

}  // namespace rbpf_core::smoothing
