// The smoother: the whole track, corrected by what its passes tell about each other.
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "rbpf_core/fix.hpp"
#include "rbpf_core/smoothing/local_map.hpp"
#include "rbpf_core/smoothing/pose_graph.hpp"
#include "rbpf_core/smoothing/registration.hpp"
#include "rbpf_core/smoothing/ties.hpp"
#include "rbpf_core/smoothing/track.hpp"

namespace rbpf_core::smoothing {

// One attempt to register a window of pings on the map of an older one.
struct Closure {
  // Nodes: of the older window and of the younger one.
  std::size_t k = 0;
  std::size_t j = 0;
  double stamp_older_s = 0.0;
  double stamp_s = 0.0;
  // Of node j in the frame of node k, where it was expected.
  Pose2 expected;
  // What registration moved node j by, in map, about itself: x, y, yaw.
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();
  Registration registration;
  // What it tells about single nodes, if accepted: that is what the graph is given.
  std::vector<Tie> ties;
  // Of the ties in the graph, the mean: 1 counts fully. NaN if refused.
  double weight = 0.0;
};

// Incremental in work: a window is registered once, its map made once, and the graph starts from
// its last solution. Used by one thread at a time.
class Smoother {
 public:
  // Throws std::invalid_argument that names a parameter which is out of range.
  Smoother(const SmoothingParams& params, double stamp_s, const Pose2& start);

  // The survey in its order. Throws std::invalid_argument for a stamp earlier than the last.
  void addPing(double stamp_s, const Pose2& dead_reckoning, const Beams& levelled_m);
  // A fix at its own stamp, in any order: it tells of the node next to it in time, by the dead
  // reckoning between both. Well after the last node it gets a node of its own, after which pings
  // should be no older.
  void addFix(const FixRecord& record);
  void finishPings();

  // Registers what is complete by now, a stretch at a time, and solves the graph after each.
  void update();
  // Once more from the beginning, from the poses that are known now: every window is cut, and laid
  // on its maps, as they say.
  void registerAgain();

  const Track& track() const { return track_; }
  const PoseGraph& graph() const { return graph_; }
  // Of the graph, at its last solution.
  PoseGraph::Covariances covariances() const;
  // In the order of the younger windows.
  const std::vector<Closure>& closures() const { return closures_; }
  // Whether any closure has been accepted.
  bool hasClosures() const { return accepted_ > 0; }
  std::size_t accepted() const { return accepted_; }
  std::size_t fixes() const { return fix_stamps_s_.size(); }
  // Of the last fix that counts for more than half.
  std::optional<double> lastGoodFix() const;
  // Whether there is anything that the filter does not know.
  bool knowsMore() const { return hasClosures() || fixes() > 0; }

  // Of every ping, in map.
  std::vector<Pose2> posesOfPings() const;
  // Of every ping: x, y, yaw in map.
  std::vector<Eigen::Matrix3d> covariancesOfPings() const;

 private:
  void addNodes();
  std::size_t nodeNextTo(double stamp_s) const;
  Eigen::Matrix2d covarianceOfLever(std::size_t node, const FixRecord& record) const;
  void closeLoops(std::size_t first, std::size_t last);
  using CovariancesNow = std::function<const PoseGraph::Covariances&()>;
  struct Pass;
  std::vector<Pass> passesNear(std::size_t j, const std::vector<Pose2>& poses, double by_m) const;
  std::vector<std::size_t> olderPasses(std::size_t j, const std::vector<Pose2>& poses,
                                       const CovariancesNow& covariances) const;
  const LocalMap& mapOf(std::size_t k, const std::vector<Pose2>& poses);
  Eigen::Matrix3d odometryWithin(double both_s) const;
  std::vector<Tie> tied(const Closure& closure, const std::vector<Pose2>& poses);
  // Registers node j's window on the older passes near it.
  void registerNode(std::size_t j, const std::vector<Pose2>& poses,
                    const CovariancesNow& covariances);
  // With the closures that have been accepted since.
  void solve();

  const SmoothingParams params_;
  Track track_;
  PoseGraph graph_;
  std::map<std::size_t, LocalMap> maps_;
  std::vector<Closure> closures_;
  std::vector<std::size_t> in_graph_;  // closures_ that are, in the order of the graph's
  std::vector<std::size_t> pending_;   // accepted, not in the graph yet
  std::size_t accepted_ = 0;
  std::vector<double> fix_stamps_s_;  // in the order of the graph's
  // Fixes have come since the graph was solved.
  bool fixes_pending_ = false;
  // The next node to be registered.
  std::size_t next_ = 0;
};

}  // namespace rbpf_core::smoothing
