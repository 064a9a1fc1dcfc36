#include "rbpf_core/smoothing/track.hpp"

#include <algorithm>
#include <stdexcept>
#include <string>

#include "rbpf_core/rigid.hpp"
#include "rbpf_core/smoothing/thinned.hpp"

namespace rbpf_core::smoothing {

namespace {

// Beams, given in the frame of a pose, in the frame that the pose is given in.
Beams placed(const Beams& beams_m, const Pose2& pose) {
  const auto c = static_cast<float>(std::cos(pose.yaw_rad));
  const auto s = static_cast<float>(std::sin(pose.yaw_rad));
  Beams out(3, beams_m.cols());
  out.row(0) = c * beams_m.row(0) - s * beams_m.row(1);
  out.row(1) = s * beams_m.row(0) + c * beams_m.row(1);
  out.row(0).array() += static_cast<float>(pose.x_m);
  out.row(1).array() += static_cast<float>(pose.y_m);
  out.row(2) = beams_m.row(2);
  return out;
}

float halfWidth(const Beams& beams_m) {
  if (beams_m.cols() == 0) return 0.0F;
  Eigen::ArrayXf across = beams_m.row(1).array().abs().transpose();
  const auto at = across.data() + across.size() * 9 / 10;
  std::nth_element(across.data(), at, across.data() + across.size());
  return *at;
}

}  // namespace

std::size_t Track::addNode(double stamp_s, const Pose2& dead_reckoning) {
  if (!nodes_.empty() && !(stamp_s >= nodes_.back().stamp_s)) {
    throw std::invalid_argument("stamp " + std::to_string(stamp_s) +
                                " s; expected none earlier than the node's before, " +
                                std::to_string(nodes_.back().stamp_s) + " s");
  }
  closeNode();
  nodes_.push_back({stamp_s, dead_reckoning, Beams(3, 0), 0.0F});
  return nodes_.size() - 1;
}

void Track::addPing(double stamp_s, const Pose2& dead_reckoning, const Beams& levelled_m) {
  if (!pings_.empty() && !(stamp_s >= pings_.back().stamp_s)) {
    throw std::invalid_argument("ping of stamp " + std::to_string(stamp_s) +
                                " s; expected none earlier than the ping before, " +
                                std::to_string(pings_.back().stamp_s) + " s");
  }
  if (open_ == 0 || stamp_s - nodes_.back().stamp_s >= node_period_s_) {
    // a ping that comes late may be a little older than the place of a fix
    addNode(pings_.empty() ? stamp_s : std::max(stamp_s, nodes_.back().stamp_s), dead_reckoning);
    open_ = 1;
    finished_ = false;
  }
  const Pose2 in_node = relative(nodes_.back().dead_reckoning, dead_reckoning);
  pings_.push_back({nodes_.size() - 1, stamp_s, in_node});
  growing_.push_back(placed(levelled_m, in_node));
}

void Track::closeNode() {
  if (open_ == 0) return;
  open_ = 0;
  Eigen::Index beams = 0;
  for (const Beams& ping : growing_) beams += ping.cols();
  Beams all(3, beams);
  Eigen::Index first = 0;
  for (const Beams& ping : growing_) {
    all.middleCols(first, ping.cols()) = ping;
    first += ping.cols();
  }
  growing_.clear();
  nodes_.back().half_width_m = halfWidth(all);
  nodes_.back().beams_m = thinned(all, kBeams);
}

void Track::finish() {
  closeNode();
  finished_ = true;
}

// A node's beams lie after it: the last one ends where the next begins.
Track::Range Track::around(std::size_t k, double half_s) const {
  const double middle_s = nodes_[k].stamp_s;
  Range range{k, k + 1};
  while (range.first > 0 && middle_s - nodes_[range.first - 1].stamp_s <= half_s) --range.first;
  while (range.last < complete() &&
         nodes_[range.last].stamp_s + node_period_s_ - middle_s <= half_s) {
    ++range.last;
  }
  return range;
}

Beams gather(const Track& track, const Track::Range& range, const std::vector<Pose2>& poses,
             std::size_t in, Eigen::Index stride) {
  const auto kept = [stride](const TrackNode& node) {
    return (node.beams_m.cols() + stride - 1) / stride;
  };
  Eigen::Index beams = 0;
  for (std::size_t i = range.first; i < range.last; ++i) beams += kept(track.nodes()[i]);
  Beams out(3, beams);
  Eigen::Index first = 0;
  for (std::size_t i = range.first; i < range.last; ++i) {
    const TrackNode& node = track.nodes()[i];
    Beams every(3, kept(node));
    for (Eigen::Index b = 0; b < every.cols(); ++b) every.col(b) = node.beams_m.col(b * stride);
    out.middleCols(first, every.cols()) = placed(every, relative(poses[in], poses[i]));
    first += every.cols();
  }
  return out;
}

}  // namespace rbpf_core::smoothing
