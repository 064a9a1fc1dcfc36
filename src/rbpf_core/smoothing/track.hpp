// The survey as the smoother sees it: nodes along the track, each with the beams around it.
#pragma once

#include <cstddef>
#include <vector>

#include "rbpf_core/types.hpp"

namespace rbpf_core::smoothing {

// A stretch of some two seconds of track, rigid in itself.
struct TrackNode {
  double stamp_s = 0.0;
  Pose2 dead_reckoning;
  // [3, n], thinned: x and y in the node's own frame, by dead reckoning; z in map.
  Beams beams_m;
  // Of the swath to either side: nine tenths of the beams lie within.
  float half_width_m = 0.0F;
};

// A ping by its node.
struct PingPlace {
  std::size_t node;
  double stamp_s;
  // In the node's frame, by dead reckoning.
  Pose2 in_node;
};

class Track {
 public:
  // Of a node's beams so many are kept.
  static constexpr Eigen::Index kBeams = 600;

  explicit Track(double node_period_s) : node_period_s_(node_period_s) {}

  // A node without beams: the start, or a place that something else is known of. Stamps must not go
  // back.
  std::size_t addNode(double stamp_s, const Pose2& dead_reckoning);
  // Throws std::invalid_argument if the stamp is earlier than the last one.
  void addPing(double stamp_s, const Pose2& dead_reckoning, const Beams& levelled_m);
  // The last node has all of its beams; a ping after that begins another.
  void finish();

  const std::vector<TrackNode>& nodes() const { return nodes_; }
  const std::vector<PingPlace>& pings() const { return pings_; }
  // Nodes that have all of their beams.
  std::size_t complete() const { return finished_ ? nodes_.size() : nodes_.size() - open_; }

  bool isFinished() const { return finished_; }

  // Nodes within so many seconds of node k, [first, last).
  struct Range {
    std::size_t first, last;
  };
  Range around(std::size_t k, double half_s) const;

 private:
  void closeNode();

  const double node_period_s_;
  std::vector<TrackNode> nodes_;
  std::vector<PingPlace> pings_;
  // Of the node that is growing, not thinned yet.
  std::vector<Beams> growing_;
  std::size_t open_ = 0;  // 1 while a node is growing
  bool finished_ = false;
};

// Beams of some nodes, in the frame of the node `in`: each node's lie where its pose has them.
// Every `stride`-th beam.
Beams gather(const Track& track, const Track::Range& range, const std::vector<Pose2>& poses,
             std::size_t in, Eigen::Index stride = 1);

}  // namespace rbpf_core::smoothing
