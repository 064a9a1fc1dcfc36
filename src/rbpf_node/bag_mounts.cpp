#include "rbpf_node/bag_mounts.hpp"

#include <rosbag/view.h>
#include <tf2_eigen/tf2_eigen.h>
#include <tf2_msgs/TFMessage.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

namespace rbpf_node {

namespace {

using geometry_msgs::TransformStamped;

// What a mount may move by, rounding included, before it is another.
constexpr double kStill_m = 1e-3;
constexpr double kStill_rad = 1e-3;
// of a quaternion's squared norm, as tf2 has it
constexpr double kSquaredNormTolerance = 0.01;

struct Link {
  TransformStamped first;
  bool is_static;
  std::optional<TransformStamped> changed = std::nullopt;
};

// by child frame
using Links = std::map<std::string, Link>;

bool differ(const TransformStamped& a, const TransformStamped& b) {
  const Eigen::Isometry3d T_a = tf2::transformToEigen(a);
  const Eigen::Isometry3d T_b = tf2::transformToEigen(b);
  const Eigen::AngleAxisd turn(T_a.rotation().transpose() * T_b.rotation());
  return a.header.frame_id != b.header.frame_id ||
         (T_a.translation() - T_b.translation()).norm() > kStill_m || turn.angle() > kStill_rad;
}

bool isRotation(const geometry_msgs::Quaternion& q) {
  // false for NaN
  return std::abs(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w - 1.0) <= kSquaredNormTolerance;
}

void addTopic(const rosbag::Bag& bag, const std::string& topic, bool is_static, Links* links) {
  for (const rosbag::MessageInstance& instance : rosbag::View(bag, rosbag::TopicQuery(topic))) {
    const auto message = instance.instantiate<tf2_msgs::TFMessage>();
    if (!message) continue;  // of another type
    for (TransformStamped transform : message->transforms) {
      if (!isRotation(transform.transform.rotation)) continue;
      transform.header.frame_id = withoutSlash(transform.header.frame_id);
      transform.child_frame_id = withoutSlash(transform.child_frame_id);
      const auto [known, is_new] =
          links->try_emplace(transform.child_frame_id, Link{transform, is_static});
      Link& link = known->second;
      // what is static outranks /tf
      const bool is_same_kind = link.is_static == is_static;
      if (!is_new && is_same_kind && differ(link.first, transform)) link.changed = transform;
    }
  }
}

// A frame, its parent, and so on up to the root.
std::vector<std::string> lineOf(const std::string& frame, const Links& links) {
  std::vector<std::string> line = {frame};
  for (auto link = links.find(frame); link != links.end(); link = links.find(line.back())) {
    const std::string& parent = link->second.first.header.frame_id;
    if (std::find(line.begin(), line.end(), parent) != line.end()) break;  // a circle
    line.push_back(parent);
  }
  return line;
}

// The child frames of the links between two frames; nothing if they do not hang together, or only
// by a frame in which the vehicle moves.
std::optional<std::vector<std::string>> wayBetween(const std::string& a, const std::string& b,
                                                   const Links& links, const Frames& frames) {
  const std::vector<std::string> line_a = lineOf(a, links);
  const std::vector<std::string> line_b = lineOf(b, links);
  const auto meeting_a =
      std::find_first_of(line_a.begin(), line_a.end(), line_b.begin(), line_b.end());
  if (meeting_a == line_a.end()) return std::nullopt;
  const auto meeting_b = std::find(line_b.begin(), line_b.end(), *meeting_a);
  std::vector<std::string> way(line_a.begin(), meeting_a);
  way.insert(way.end(), line_b.begin(), meeting_b);
  const auto moves = [&](const std::string& frame) {
    return frame == frames.odom || frame == frames.map;
  };
  if (moves(*meeting_a) || std::any_of(way.begin(), way.end(), moves)) return std::nullopt;
  return way;
}

bool allMounted(const std::set<std::string>& sensors, const Links& links, const Frames& frames) {
  return std::all_of(sensors.begin(), sensors.end(), [&](const std::string& sensor) {
    return wayBetween(frames.base, sensor, links, frames).has_value();
  });
}

}  // namespace

Mounts mountsIn(const rosbag::Bag& bag, const Frames& frames,
                const std::set<std::string>& sensors) {
  Links links;
  Mounts mounts;
  const auto add = [&mounts](const Link& link) {
    mounts.first.push_back(link.first);
    if (link.changed) mounts.changed.push_back(*link.changed);
  };
  addTopic(bag, "/tf_static", true, &links);
  for (const auto& [child, link] : links) add(link);
  // /tf is long, and most bags need nothing of it
  if (allMounted(sensors, links, frames)) return mounts;
  addTopic(bag, "/tf", false, &links);
  std::set<std::string> of_tf;
  for (const std::string& sensor : sensors) {
    for (const std::string& child :
         wayBetween(frames.base, sensor, links, frames).value_or(std::vector<std::string>())) {
      if (!links.at(child).is_static) of_tf.insert(child);
    }
  }
  for (const std::string& child : of_tf) add(links.at(child));
  return mounts;
}

void setMounts(const std::vector<TransformStamped>& mounts, const rosbag::Bag& bag,
               tf2_ros::Buffer* transforms) {
  for (const TransformStamped& mount : mounts) {
    transforms->setTransform(mount, bag.getFileName(), true);
  }
}

}  // namespace rbpf_node
