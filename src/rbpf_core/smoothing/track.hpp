// The survey as the smoother sees it: nodes along the track, each with the beams around it.
#pragma once

#include <cstddef>
#include <vector>

#include "rbpf_core/types.hpp"

namespace rbpf_core::smoothing {

// The middle of a stretch of some two seconds of track, which is rigid in itself.
struct TrackNode {
  double stamp_s = 0.0;
  Pose2 dead_reckoning;
  // [3, n], thinned: x and y in the node's own frame, by dead reckoning; z in map.
  Beams beams_m;
  // Of the swath to either side: nine tenths of the beams lie within.
  float half_width_m = 0.0F;
};

struct PingPlace {
  double stamp_s;
  Pose2 dead_reckoning;
};

class Track {
 public:
  // Of a node's beams so many are kept.
  static constexpr Eigen::Index kBeams = 2400;

  explicit Track(double node_period_s) : node_period_s_(node_period_s) {}

  // A node without beams: the start, or a place that something else is known of; the stretch that
  // is growing ends before it. Stamps must not go back.
  std::size_t addNode(double stamp_s, const Pose2& dead_reckoning);
  // Throws std::invalid_argument if the stamp is earlier than the last one.
  void addPing(double stamp_s, const Pose2& dead_reckoning, const Beams& levelled_m);
  // The stretch that is growing ends; a ping after that begins another.
  void finish();

  // Of stretches that have ended.
  const std::vector<TrackNode>& nodes() const { return nodes_; }
  const std::vector<PingPlace>& pings() const { return pings_; }
  bool isFinished() const { return finished_; }

  // Nodes within so many seconds of node k, [first, last).
  struct Range {
    std::size_t first, last;
  };
  Range around(std::size_t k, double half_s) const;

 private:
  void endStretch();

  const double node_period_s_;
  std::vector<TrackNode> nodes_;
  std::vector<PingPlace> pings_;
  // Of the last pings, which are no node yet: the beams in each ping's own frame.
  std::vector<Beams> growing_;
  bool finished_ = false;
};

// Beams [3, n] of a frame whose pose is given, in the frame that the pose is given in.
Beams placed(const Beams& beams_m, const Pose2& pose);

// Beams of some nodes, in the frame of the node `in`: each node's lie where its pose has them.
// Every `stride`-th beam.
Beams gather(const Track& track, const Track::Range& range, const std::vector<Pose2>& poses,
             std::size_t in, Eigen::Index stride = 1);

}  // namespace rbpf_core::smoothing
