#include "rbpf_core/smoothing/smoother.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "rbpf_core/rigid.hpp"

namespace rbpf_core::smoothing {

namespace {

// Every so many nodes a window is registered; older windows lie at multiples of it too, so that
// their maps serve more than once.
constexpr std::size_t kEvery = 2;
// Nodes that are registered between two solutions of the graph: at least so many, or this share of
// all.
constexpr std::size_t kStretch = 15;
constexpr double kStretchShare = 0.05;
// Passes overlap enough if their tracks are nearer than this share of both half swaths.
constexpr double kNear = 0.75;
// They may do so, for all that is known, if they are further apart by this many standard
// deviations.
constexpr double kPerhaps = 2.0;
// Two nodes near a place belong to different passes if they are further apart than this, s.
constexpr double kSamePass_s = 16.0;
// Of a window's beams, one of so many is registered.
constexpr Eigen::Index kStride = 3;
// Covariances are computed at so many nodes, and interpolated.
constexpr std::size_t kCovariances = 600;

void expectPositive(const char* name, double value) {
  if (std::isfinite(value) && value > 0.0) return;
  throw std::invalid_argument(std::string("smoothing/") + name + " is " + std::to_string(value) +
                              "; expected a finite number above 0");
}

const SmoothingParams& checked(const SmoothingParams& params) {
  const RegistrationParams& registration = params.registration;
  expectPositive("node_period_s", registration.node_period_s);
  expectPositive("window_s", registration.window_s);
  expectPositive("map_window_s", registration.map_window_s);
  expectPositive("min_apart_s", registration.min_apart_s);
  expectPositive("passes", registration.passes);
  expectPositive("effective_beams", registration.effective_beams);
  expectPositive("max_search_m", registration.max_search_m);
  return params;
}

}  // namespace

Smoother::Smoother(const SmoothingParams& params, double stamp_s, const Pose2& start)
    : params_(checked(params)),
      track_(params.registration.node_period_s),
      graph_(params, stamp_s, start) {
  track_.addNode(stamp_s, start);
}

void Smoother::addPing(double stamp_s, const Pose2& dead_reckoning, const Beams& levelled_m) {
  track_.addPing(stamp_s, dead_reckoning, levelled_m);
  addNodes();
}

void Smoother::finishPings() {
  track_.finish();
  addNodes();
}

void Smoother::addNodes() {
  const std::vector<TrackNode>& nodes = track_.nodes();
  for (std::size_t i = graph_.size(); i < nodes.size(); ++i) {
    graph_.addNode(nodes[i].stamp_s,
                   relative(nodes[i - 1].dead_reckoning, nodes[i].dead_reckoning));
  }
}

void Smoother::addFix(const FixRecord& record) {
  const double stamp_s = record.fix.stamp_s;
  double last_s = track_.nodes().back().stamp_s;
  if (!track_.pings().empty()) last_s = std::max(last_s, track_.pings().back().stamp_s);
  if (stamp_s - last_s > params_.registration.node_period_s) {
    track_.addNode(stamp_s, record.dead_reckoning);
    addNodes();
  }
  const std::size_t node = nodeNextTo(stamp_s);
  const Pose2 lever = relative(track_.nodes()[node].dead_reckoning, record.dead_reckoning);
  graph_.addFix(node, record.fix.position_m,
                record.fix.covariance_m2 + covarianceOfLever(node, record), {lever.x_m, lever.y_m},
                !record.fix.heading);
  if (const auto& heading = record.fix.heading) {
    const double drift_rad = params_.motion.yaw_std_rad;
    graph_.addHeading(node, heading->yaw_rad - lever.yaw_rad,
                      heading->variance_rad2 +
                          drift_rad * drift_rad * std::abs(stamp_s - track_.nodes()[node].stamp_s));
  }
  fix_stamps_s_.push_back(stamp_s);
  fixes_pending_ = true;
}

std::optional<double> Smoother::lastGoodFix() const {
  std::optional<double> last_s;
  for (std::size_t i = 0; i < fixes(); ++i) {
    if (graph_.weightOfFix(i) < 0.5) continue;
    last_s = std::max(fix_stamps_s_[i], last_s.value_or(fix_stamps_s_[i]));
  }
  return last_s;
}

std::size_t Smoother::nodeNextTo(double stamp_s) const {
  const std::vector<TrackNode>& nodes = track_.nodes();
  const auto after =
      std::upper_bound(nodes.begin(), nodes.end(), stamp_s,
                       [](double stamp, const TrackNode& node) { return stamp < node.stamp_s; });
  const auto i = static_cast<std::size_t>(after - nodes.begin());
  if (i == 0) return 0;
  if (i == nodes.size()) return i - 1;
  return stamp_s - nodes[i - 1].stamp_s <= nodes[i].stamp_s - stamp_s ? i - 1 : i;
}

// What the odometry may have drifted between a node and a fix, whatever the heading.
Eigen::Matrix2d Smoother::covarianceOfLever(std::size_t node, const FixRecord& record) const {
  const TrackNode& at = track_.nodes()[node];
  const MotionNoise& noise = params_.motion;
  const double duration_s = std::abs(record.fix.stamp_s - at.stamp_s);
  const double position_std_m = std::max(noise.surge_std_m, noise.sway_std_m);
  const double length_m = std::hypot(record.dead_reckoning.x_m - at.dead_reckoning.x_m,
                                     record.dead_reckoning.y_m - at.dead_reckoning.y_m);
  const double aside_std_m = noise.yaw_std_rad * length_m;
  return duration_s * (position_std_m * position_std_m + aside_std_m * aside_std_m / 3.0) *
         Eigen::Matrix2d::Identity();
}

void Smoother::update() {
  if (fixes_pending_) graph_.solve();
  fixes_pending_ = false;
  // A window is complete when the nodes after it are there.
  std::size_t complete = track_.nodes().size();
  const double last_s = track_.nodes().back().stamp_s;
  while (complete > next_ && !track_.isFinished() &&
         last_s - track_.nodes()[complete - 1].stamp_s < params_.registration.window_s) {
    --complete;
  }
  while (next_ < complete) {
    const auto share = static_cast<std::size_t>(kStretchShare * static_cast<double>(next_));
    const std::size_t last = std::min(complete, next_ + std::max(kStretch, share));
    closeLoops(next_, last);
    next_ = last;
  }
}

void Smoother::registerAgain() {
  if (accepted_ == 0) return;
  // What the closures say is still needed to know where to look.
  const std::vector<Pose2> poses = graph_.poses();
  const PoseGraph::Covariances known = covariances();
  graph_.clearClosures();
  maps_.clear();
  closures_.clear();
  in_graph_.clear();
  accepted_ = 0;
  for (std::size_t j = 0; j < next_; j += kEvery) {
    registerNode(j, poses, [&]() -> const PoseGraph::Covariances& { return known; });
  }
  if (pending_.empty()) graph_.solve();  // without any
  solve();
}

// ---- closures ----------------------------------------------------------------------------------

void Smoother::closeLoops(std::size_t first, std::size_t last) {
  const std::vector<Pose2> poses = graph_.poses();
  std::optional<PoseGraph::Covariances> known;
  const auto covariancesNow = [&]() -> const PoseGraph::Covariances& {
    return known ? *known : known.emplace(graph_, kShareOfTies);
  };
  for (std::size_t j = (first + kEvery - 1) / kEvery * kEvery; j < last; j += kEvery) {
    registerNode(j, poses, covariancesNow);
  }
  solve();
}

void Smoother::registerNode(std::size_t j, const std::vector<Pose2>& poses,
                            const CovariancesNow& covariances) {
  if (track_.nodes()[j].beams_m.cols() == 0) return;  // the place of a fix
  const std::vector<std::size_t> older = olderPasses(j, poses, covariances);
  if (older.empty()) return;
  const Track::Range range = track_.around(j, params_.registration.window_s);
  const WindowOfPings window{gather(track_, range, poses, j, kStride),
                             LocalMap(gather(track_, range, poses, j))};
  for (const std::size_t k : older) {
    Closure closure;
    closure.k = k;
    closure.j = j;
    closure.stamp_older_s = track_.nodes()[k].stamp_s;
    closure.stamp_s = track_.nodes()[j].stamp_s;
    closure.expected = relative(poses[k], poses[j]);
    closure.registration =
        registerWindow(mapOf(k, poses), window, {closure.expected, covariances().ofRelative(k, j)},
                       params_.registration);
    closure.registration.found.covariance += odometryWithin(2.0 * params_.registration.window_s);
    const Pose2 moved = relative(poses[j], compose(poses[k], closure.registration.found.pose));
    closure.shift << Eigen::Rotation2Dd(poses[j].yaw_rad) * Eigen::Vector2d(moved.x_m, moved.y_m),
        moved.yaw_rad;
    closure.weight = std::numeric_limits<double>::quiet_NaN();
    if (closure.registration.verdict == Verdict::kAccepted) {
      closure.ties = tied(closure, poses);
      pending_.push_back(closures_.size());
      ++accepted_;
    }
    closures_.push_back(closure);
  }
}

// Each younger node's beams are used once a pass: those between this window's middle and the
// next's.
std::vector<Tie> Smoother::tied(const Closure& closure, const std::vector<Pose2>& poses) {
  const Track::Range around_k = track_.around(closure.k, params_.registration.map_window_s);
  const Track::Range younger{closure.j, std::min(closure.j + kEvery, track_.nodes().size())};
  std::vector<Tie> ties =
      tiesOf({track_, poses, closure.k, closure.j, around_k, mapOf(closure.k, poses),
              closure.registration, params_.registration.effective_beams},
             younger);
  if (ties.empty()) return {{closure.k, closure.j, closure.registration.found}};  // few beams
  for (Tie& tie : ties)
    tie.relative.covariance += odometryWithin(params_.registration.node_period_s);
  return ties;
}

void Smoother::solve() {
  for (const std::size_t closure : pending_) {
    for (const Tie& tie : closures_[closure].ties) {
      graph_.addClosure(tie.older, tie.newer, tie.relative);
    }
    in_graph_.push_back(closure);
  }
  if (!pending_.empty()) graph_.solve();
  pending_.clear();
  std::size_t tie = 0;
  for (const std::size_t closure : in_graph_) {
    const std::size_t ties = closures_[closure].ties.size();
    double sum = 0.0;
    for (std::size_t i = 0; i < ties; ++i) sum += graph_.weightOfClosure(tie++);
    closures_[closure].weight = sum / static_cast<double>(ties);
  }
}

// What is laid on what is rigid, though the odometry bends it: of a random walk of variance v per
// second, the mean over T seconds to either side has the variance v T / 6. `both_s`: the T of both
// added up, as far as they lie on each other.
Eigen::Matrix3d Smoother::odometryWithin(double both_s) const {
  const MotionNoise& motion = params_.motion;
  return both_s / 6.0 *
         Eigen::Vector3d(std::max(motion.surge_std_m, motion.sway_std_m),
                         std::max(motion.surge_std_m, motion.sway_std_m), motion.yaw_std_rad)
             .cwiseAbs2()
             .asDiagonal()
             .toDenseMatrix();
}

// Of an older one, its nearest node.
struct Smoother::Pass {
  double distance_m;
  double beyond_m;  // the distance at which passes are near
  std::size_t node;
};

// The older passes that come near, or no more than so much further off, the nearest first.
std::vector<Smoother::Pass> Smoother::passesNear(std::size_t j, const std::vector<Pose2>& poses,
                                                 double by_m) const {
  const std::vector<TrackNode>& nodes = track_.nodes();
  std::vector<Pass> passes;
  double last_near_s = -std::numeric_limits<double>::infinity();
  for (std::size_t k = 1; k < j; ++k) {  // the start has no beams
    if (nodes[j].stamp_s - nodes[k].stamp_s < params_.registration.min_apart_s) break;
    if (nodes[k].beams_m.cols() == 0) continue;  // the place of a fix
    const double near_m = kNear * (nodes[j].half_width_m + nodes[k].half_width_m);
    const double distance_m = std::hypot(poses[j].x_m - poses[k].x_m, poses[j].y_m - poses[k].y_m);
    if (!(distance_m < near_m + by_m)) continue;
    const Pass pass{distance_m, distance_m - near_m, k};
    if (nodes[k].stamp_s - last_near_s > kSamePass_s) {
      passes.push_back(pass);
    } else if (distance_m < passes.back().distance_m) {
      passes.back() = pass;
    }
    last_near_s = nodes[k].stamp_s;
  }
  std::sort(passes.begin(), passes.end(),
            [](const Pass& a, const Pass& b) { return a.distance_m < b.distance_m; });
  return passes;
}

// A node of each older pass that comes near, the nearest passes first; if they are too few, of
// those that may be near for all that is known of both places.
std::vector<std::size_t> Smoother::olderPasses(std::size_t j, const std::vector<Pose2>& poses,
                                               const CovariancesNow& covariances) const {
  const auto wanted = static_cast<std::size_t>(params_.registration.passes);
  std::vector<std::size_t> older;
  const auto take = [&](const Pass& pass) {
    const std::size_t k = std::max<std::size_t>(1, pass.node / kEvery * kEvery);
    older.push_back(track_.nodes()[k].beams_m.cols() > 0 ? k : pass.node);
  };
  for (const Pass& pass : passesNear(j, poses, 0.0)) {
    if (older.size() == wanted) return older;
    take(pass);
  }
  for (const Pass& pass : passesNear(j, poses, params_.registration.max_search_m)) {
    if (older.size() == wanted) break;
    if (pass.beyond_m < 0.0) continue;  // taken
    const Pose2 expected = relative(poses[pass.node], poses[j]);
    const Eigen::Vector2d there(expected.x_m / pass.distance_m, expected.y_m / pass.distance_m);
    const Eigen::Matrix2d known = covariances().ofRelative(pass.node, j).topLeftCorner<2, 2>();
    if (pass.beyond_m < kPerhaps * std::sqrt(there.dot(known * there))) take(pass);
  }
  return older;
}

const LocalMap& Smoother::mapOf(std::size_t k, const std::vector<Pose2>& poses) {
  const auto found = maps_.find(k);
  if (found != maps_.end()) return found->second;
  const Track::Range range = track_.around(k, params_.registration.map_window_s);
  return maps_.emplace(k, LocalMap(gather(track_, range, poses, k))).first->second;
}

// ---- the track ---------------------------------------------------------------------------------

std::vector<Pose2> Smoother::posesOfPings() const {
  const std::vector<TrackNode>& nodes = track_.nodes();
  const std::vector<Pose2> at_nodes = graph_.poses();
  std::vector<Pose2> poses;
  std::size_t i = 0;
  for (const PingPlace& ping : track_.pings()) {
    while (i + 1 < nodes.size() && nodes[i + 1].stamp_s <= ping.stamp_s) ++i;
    const auto from = [&](std::size_t node) {
      return compose(at_nodes[node], relative(nodes[node].dead_reckoning, ping.dead_reckoning));
    };
    Pose2 pose = from(i);
    // From the node before and, more and more, from the node after.
    if (i + 1 < nodes.size()) {
      const double duration_s = nodes[i + 1].stamp_s - nodes[i].stamp_s;
      const double since_s = std::max(0.0, ping.stamp_s - nodes[i].stamp_s);
      if (duration_s > 0.0) pose = interpolate(pose, from(i + 1), since_s / duration_s);
    }
    poses.push_back(pose);
  }
  return poses;
}

PoseGraph::Covariances Smoother::covariances() const {
  return PoseGraph::Covariances(graph_, kShareOfTies);
}

std::vector<Eigen::Matrix3d> Smoother::covariancesOfPings() const {
  const std::size_t nodes = graph_.size();
  const PoseGraph::Covariances known = covariances();
  const std::size_t stride = 1 + nodes / kCovariances;
  std::vector<std::size_t> at;
  for (std::size_t i = 0; i < nodes; i += stride) at.push_back(i);
  if (at.back() + 1 < nodes) at.push_back(nodes - 1);
  std::vector<Eigen::Matrix3d> of_nodes;
  for (const std::size_t i : at) of_nodes.push_back(known.of(i));
  std::vector<Eigen::Matrix3d> of_pings;
  std::size_t a = 0;
  const auto stamp = [&](std::size_t i) { return track_.nodes()[at[i]].stamp_s; };
  for (const PingPlace& ping : track_.pings()) {
    while (a + 2 < at.size() && stamp(a + 1) <= ping.stamp_s) ++a;
    const std::size_t b = std::min(a + 1, at.size() - 1);
    const double duration_s = stamp(b) - stamp(a);
    const double share =
        duration_s > 0.0 ? std::clamp((ping.stamp_s - stamp(a)) / duration_s, 0.0, 1.0) : 0.0;
    of_pings.push_back((1.0 - share) * of_nodes[a] + share * of_nodes[b]);
  }
  return of_pings;
}

}  // namespace rbpf_core::smoothing
