// The particles' maps as Algorithm 2 sees them, wherever and by whatever engine they are kept.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "rbpf_core/types.hpp"

namespace rbpf_core {

// What the map nodes last said of themselves, put together.
struct MapsState {
  // B
  std::size_t nodes = 0;
  // Nodes that have reported under the epoch asked for.
  std::size_t nodes_heard = 0;
  // Of each of those nodes: corrections of the past that all of its maps have followed.
  std::vector<std::uint32_t> pasts;
  // Maps of those nodes whose training has converged.
  std::size_t maps_ready = 0;
  // Of each particle's map, the moving average of its training objective, nats per beam, [J]; NaN
  // where its node has not told one.
  Eigen::ArrayXd elbo;
  // Training steps of all nodes since they started.
  std::uint64_t steps = 0;
};

// What a resampling brought from one node to another.
struct MovedMaps {
  std::uint32_t maps = 0;
  std::uint64_t bytes = 0;
};

// J maps, one for each particle, spread over B nodes. An epoch is the number of resamplings that
// the particles have gone through: maps of another epoch belong to other particles, and neither
// report nor predict under this one.
//
// A resampling takes two phases: prepare, then commit or abort. Maps keep both generations in
// between, so that nothing is lost if one of them fails.
//
// Whatever fails, in a map node or on the way there, is reported by an exception that names the
// node. A node that does not answer in time has failed.
class Maps {
 public:
  virtual ~Maps() = default;

  virtual MapsState state(std::uint32_t epoch) const = 0;

  // The node that keeps each particle's map, [J].
  virtual const std::vector<std::uint32_t>& nodeOf() const = 0;

  // What each particle's own map predicts where that particle saw the ping's beams.
  virtual PingPrediction predict(std::uint32_t epoch, const PlacedPing& ping) = 0;

  // First phase of the resampling that leads to `epoch`: particle j inherits the map of
  // ancestors[j]. If it fails, abort is due.
  virtual MovedMaps prepare(std::uint32_t epoch, const std::vector<std::uint32_t>& ancestors) = 0;

  // Second phase: the new maps are taken, or the old ones kept. A node that cannot be told asks for
  // the epoch itself, later.
  virtual void commit(std::uint32_t epoch) = 0;
  virtual void abort(std::uint32_t epoch) = 0;
};

}  // namespace rbpf_core
