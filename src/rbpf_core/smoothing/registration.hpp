// Where a window of pings lies on the map of an older one.
#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "rbpf_core/smoothing/local_map.hpp"
#include "rbpf_core/smoothing/smoothing_params.hpp"

namespace rbpf_core::smoothing {

enum class Verdict {
  kAccepted,
  // Too few of the beams lie on the map.
  kLittleOverlap,
  // The beams lie further off the map than its own did.
  kBadFit,
  // The relief tells in no direction where the window lies.
  kFlat,
  // Another place fits about as well, or the best one is where the window cannot be.
  kAmbiguous,
};

// The names that Closure.msg gives them.
const char* nameOf(Verdict verdict);

// A pose and how well it is known: of x, y, yaw, in the frame that the pose is given in.
struct UncertainPose {
  Pose2 pose;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
};

struct Registration {
  Verdict verdict = Verdict::kLittleOverlap;
  // Of the window in the map's frame. Meaningful if accepted; else the best that was found.
  UncertainPose found;
  // Of the beams that lie on the map, robust.
  double rms_m = 0.0;
  std::uint32_t beams = 0;
  // Takes a slope of the map to the part of it that the window's own map has too, and not noise
  // alone; and the share of that part's square that both have.
  Eigen::Matrix2d told = Eigen::Matrix2d::Zero();
  double share = 0.0;
};

// A window of pings: beams [3, n] in its own frame, and the map that they make by themselves.
struct WindowOfPings {
  Beams beams_m;
  LocalMap map;
};

// Lays a window on a map, somewhere around where it is expected: a search on a grid as wide as the
// expectation is uncertain, then Gauss-Newton with robust weights from the best few places.
Registration registerWindow(const LocalMap& map, const WindowOfPings& window,
                            const UncertainPose& expected, const RegistrationParams& params);

}  // namespace rbpf_core::smoothing
