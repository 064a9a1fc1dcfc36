// Beams for the maps: minibatches, the paper's Algorithm 1.
#pragma once

#include "rbpf_core/mbes_log.hpp"
#include "rbpf_core/random.hpp"
#include "rbpf_core/trajectory_history.hpp"

namespace rbpf_core {

// A beam placed by one particle: x, y relative to an origin in map, z in map.
struct PlacedBeam {
  float x_m, y_m, z_m;
};
static_assert(sizeof(PlacedBeam) == 3 * sizeof(float), "is sent as these bytes");

// The survey origin: coordinates on the wire count from here, so that float32 is enough anywhere.
struct Origin {
  double x_m = 0.0;
  double y_m = 0.0;
};

PlacedBeam place(const LoggedBeam& beam, const HistoryPose& pose, const Origin& origin);

// `size` beams into out[0 .. size-1], drawn independently and uniformly over the log's first
// `beams` beams, with replacement, each at its own ping's pose in the particle's trajectory.
void drawMinibatch(const MbesLog& log, std::size_t beams, const Trajectories& trajectories,
                   std::size_t particle, const Origin& origin, RandomStream stream,
                   std::size_t size, PlacedBeam* out);

}  // namespace rbpf_core
