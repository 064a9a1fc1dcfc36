// The peer: histories as an ancestry tree, as in Barkby, Williams, Pizarro and Jakuba's bathymetric
// particle filter SLAM (2011, 2012), after DP-SLAM (Eliazar and Parr 2003). Implemented plainly.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "rbpf_core/trajectory_history.hpp"
#include "rbpf_core/types.hpp"

namespace bench {

// Each particle is a leaf; a node holds the poses from one resampling to the next. A pose of the
// past is found by going up from the leaf until the node that has its ping. Branches without a
// living leaf go with their last pointer.
class AncestryTree {
 public:
  explicit AncestryTree(std::size_t particles) : leaves_(particles) {
    for (auto& leaf : leaves_) leaf = std::make_shared<Node>();
  }

  void append(const std::vector<rbpf_core::Pose2>& poses) {
    for (std::size_t j = 0; j < leaves_.size(); ++j) {
      leaves_[j]->poses.push_back(rbpf_core::HistoryPose::of(poses[j]));
    }
    ++pings_;
  }

  void resample(const std::vector<std::uint32_t>& ancestors) {
    std::vector<std::shared_ptr<Node>> leaves;
    for (const std::uint32_t ancestor : ancestors) {
      leaves.push_back(std::make_shared<Node>());
      leaves.back()->parent = leaves_[ancestor];
      leaves.back()->first_ping = pings_;
    }
    leaves_ = std::move(leaves);
  }

  const rbpf_core::HistoryPose& at(std::size_t particle, std::uint32_t ping) const {
    const Node* node = leaves_[particle].get();
    while (ping < node->first_ping) node = node->parent.get();
    return node->poses[ping - node->first_ping];
  }

 private:
  struct Node {
    std::shared_ptr<Node> parent;
    std::uint32_t first_ping = 0;
    std::vector<rbpf_core::HistoryPose> poses;
  };

  std::vector<std::shared_ptr<Node>> leaves_;  // [J]
  std::uint32_t pings_ = 0;
};

}  // namespace bench
