#include "rbpf_core/trajectory_history.hpp"

#include <set>
#include <stdexcept>
#include <string>

namespace rbpf_core {

TrajectoryHistories::TrajectoryHistories(std::size_t particles) : pasts_(particles) {}

void TrajectoryHistories::append(const std::vector<Pose2>& poses) {
  if (poses.size() != pasts_.size()) {
    throw std::invalid_argument("poses of a ping: " + std::to_string(poses.size()) +
                                ", expected one for each of the " + std::to_string(pasts_.size()) +
                                " particles");
  }
  for (std::size_t j = 0; j < pasts_.size(); ++j) {
    pasts_[j].open.push_back(HistoryPose::of(poses[j]));
  }
  segment_of_ping_.push_back(static_cast<std::uint32_t>(segment_start_.size() - 1));
}

void TrajectoryHistories::resample(const std::vector<std::uint32_t>& ancestors) {
  if (ancestors.size() != pasts_.size()) {
    throw std::invalid_argument("ancestors: " + std::to_string(ancestors.size()) +
                                ", expected one for each of the " + std::to_string(pasts_.size()) +
                                " particles");
  }
  for (const std::uint32_t ancestor : ancestors) {
    if (ancestor >= pasts_.size()) {
      throw std::invalid_argument("ancestor " + std::to_string(ancestor) + ", expected below " +
                                  std::to_string(pasts_.size()));
    }
  }
  const bool segment_has_pings = pings() > segment_start_.back();
  if (segment_has_pings) {
    for (Past& past : pasts_) {
      past.open.shrink_to_fit();
      past.closed.push_back(std::make_shared<const Segment>(std::move(past.open)));
      past.open = Segment();
    }
    segment_start_.push_back(pings());
  }
  std::vector<Past> offspring;
  offspring.reserve(pasts_.size());
  for (const std::uint32_t ancestor : ancestors) offspring.push_back(pasts_[ancestor]);
  pasts_ = std::move(offspring);
}

std::size_t TrajectoryHistories::storedPoses() const {
  std::set<const Segment*> distinct;
  std::size_t poses = 0;
  for (const Past& past : pasts_) {
    poses += past.open.size();
    for (const auto& segment : past.closed) {
      if (distinct.insert(segment.get()).second) poses += segment->size();
    }
  }
  return poses;
}

}  // namespace rbpf_core
