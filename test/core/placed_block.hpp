// Blocks of the log, placed as the map nodes do.
#pragma once

#include <vector>

#include "rbpf_core/log_block.hpp"

namespace rbpf_core {

// The beams of a block at the poses of one of its particles.
inline std::vector<PlacedBeam> placed(const LogBlock& block, std::size_t row = 0) {
  std::vector<PlacedBeam> beams;
  const HistoryPose* pose = block.poses.data() + row * block.beams_of_ping.size();
  for (const std::uint32_t count : block.beams_of_ping) {
    for (std::uint32_t k = 0; k < count; ++k) {
      const LevelledBeam& beam = block.beams[beams.size()];
      beams.push_back(place({beam.x_m, beam.y_m, beam.z_m, 0}, *pose, {}));
    }
    ++pose;
  }
  return beams;
}

}  // namespace rbpf_core
