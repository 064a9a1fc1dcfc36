// What a node does with all of its maps at once.
#pragma once

#include <cstdint>
#include <vector>

#include "gmrf/map.hpp"

namespace gmrf {

// A pose ready to place beams, as it comes from the filter: 24 bytes.
struct PlacingPose {
  double x_m, y_m;
  float cos_yaw, sin_yaw;
};
static_assert(sizeof(PlacingPose) == 24, "is received as these bytes");

// Beams of some pings, levelled: x, y in the levelled body frame, z in map. Every map places them
// by the poses of its own particle.
struct LevelledBlock {
  Eigen::Matrix3Xf beams_m;
  std::vector<std::uint32_t> ping;  // of each beam, below `pings`
  std::size_t pings = 0;

  // Throws std::invalid_argument if numbers do not fit together or are not finite.
  void check() const;
  // At one particle's poses, [pings].
  Beams placed(const PlacingPose* poses) const;
};

// The block into every map; poses: [maps, pings]. Whatever is wrong is thrown as
// std::invalid_argument before any map is touched.
void foldIntoAll(const std::vector<Map*>& maps, const LevelledBlock& block,
                 const std::vector<PlacingPose>& poses, const Eigen::VectorXd& weights);

}  // namespace gmrf
