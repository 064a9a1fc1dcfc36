// A stretch of the log for maps that take in every beam once: the beams as they were logged, and
// where each particle has their pings.
#pragma once

#include <cstdint>
#include <vector>

#include "rbpf_core/mbes_log.hpp"
#include "rbpf_core/minibatch.hpp"
#include "rbpf_core/trajectory_history.hpp"

namespace rbpf_core {

// A beam's x, y still to be placed by a particle's pose: see place().
struct LevelledBeam {
  float x_m, y_m, z_m;
};
static_assert(sizeof(LevelledBeam) == 3 * sizeof(float), "is sent as these bytes");

struct LogBlock {
  std::vector<LevelledBeam> beams;
  // Of each ping, one after the other; the first and the last ping may be cut.
  std::vector<std::uint32_t> beams_of_ping;
  // [P, pings], x and y relative to the origin.
  std::vector<HistoryPose> poses;
};
static_assert(sizeof(HistoryPose) == 24, "is sent as these bytes");

// The log's beams first .. first + size - 1, and the poses of the particles asked for.
LogBlock logBlock(const MbesLog& log, std::size_t first, std::size_t size,
                  const Trajectories& trajectories, const std::vector<std::uint32_t>& particles,
                  const Origin& origin);

}  // namespace rbpf_core
