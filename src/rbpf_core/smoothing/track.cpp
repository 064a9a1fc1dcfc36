#include "rbpf_core/smoothing/track.hpp"

#include <algorithm>
#include <limits>
#include <stdexcept>
#include <string>

#include "rbpf_core/rigid.hpp"
#include "rbpf_core/smoothing/thinned.hpp"

namespace rbpf_core::smoothing {

namespace {

float halfWidth(const Beams& beams_m) {
  if (beams_m.cols() == 0) return 0.0F;
  Eigen::ArrayXf across = beams_m.row(1).array().abs().transpose();
  const auto at = across.data() + across.size() * 9 / 10;
  std::nth_element(across.data(), at, across.data() + across.size());
  return *at;
}

}  // namespace

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

std::size_t Track::addNode(double stamp_s, const Pose2& dead_reckoning) {
  double last_s = -std::numeric_limits<double>::infinity();
  if (!nodes_.empty()) last_s = nodes_.back().stamp_s;
  if (!growing_.empty()) last_s = std::max(last_s, pings_.back().stamp_s);
  if (!(stamp_s >= last_s)) {
    throw std::invalid_argument("stamp " + std::to_string(stamp_s) +
                                " s; expected none earlier than what came before, " +
                                std::to_string(last_s) + " s");
  }
  endStretch();
  nodes_.push_back({stamp_s, dead_reckoning, Beams(3, 0), 0.0F});
  return nodes_.size() - 1;
}

void Track::addPing(double stamp_s, const Pose2& dead_reckoning, const Beams& levelled_m) {
  if (pings_.empty() && !nodes_.empty() && !(stamp_s >= nodes_.back().stamp_s)) {
    throw std::invalid_argument("ping of stamp " + std::to_string(stamp_s) +
                                " s; expected none earlier than the start, " +
                                std::to_string(nodes_.back().stamp_s) + " s");
  }
  if (!pings_.empty() && !(stamp_s >= pings_.back().stamp_s)) {
    throw std::invalid_argument("ping of stamp " + std::to_string(stamp_s) +
                                " s; expected none earlier than the ping before, " +
                                std::to_string(pings_.back().stamp_s) + " s");
  }
  if (!growing_.empty() &&
      stamp_s - pings_[pings_.size() - growing_.size()].stamp_s >= node_period_s_) {
    endStretch();
  }
  finished_ = false;
  pings_.push_back({stamp_s, dead_reckoning});
  growing_.push_back(levelled_m);
}

// The node is the ping in the middle: there the odometry's wander within the stretch cancels best.
void Track::endStretch() {
  if (growing_.empty()) return;
  const std::size_t first = pings_.size() - growing_.size();
  const PingPlace& middle = pings_[first + growing_.size() / 2];
  Eigen::Index beams = 0;
  for (const Beams& ping : growing_) beams += ping.cols();
  Beams all(3, beams);
  Eigen::Index next = 0;
  for (std::size_t i = 0; i < growing_.size(); ++i) {
    const Beams& ping = growing_[i];
    all.middleCols(next, ping.cols()) =
        placed(ping, relative(middle.dead_reckoning, pings_[first + i].dead_reckoning));
    next += ping.cols();
  }
  growing_.clear();
  // pings that came late may be a little older than the place of a fix
  const double stamp_s =
      nodes_.empty() ? middle.stamp_s : std::max(middle.stamp_s, nodes_.back().stamp_s);
  nodes_.push_back({stamp_s, middle.dead_reckoning, thinned(all, kBeams), halfWidth(all)});
}

void Track::finish() {
  endStretch();
  finished_ = true;
}

// A node's beams lie half a stretch to either side of it.
Track::Range Track::around(std::size_t k, double half_s) const {
  const double middle_s = nodes_[k].stamp_s;
  const double most_s = half_s - 0.5 * node_period_s_;
  Range range{k, k + 1};
  while (range.first > 0 && middle_s - nodes_[range.first - 1].stamp_s <= most_s) --range.first;
  while (range.last < nodes_.size() && nodes_[range.last].stamp_s - middle_s <= most_s) {
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
