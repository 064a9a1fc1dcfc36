#include "rbpf_core/trajectory_history.hpp"

#include <algorithm>
#include <limits>
#include <numeric>
#include <set>
#include <stdexcept>
#include <string>

namespace rbpf_core {

namespace {

// Segments that each particle has room for at first.
constexpr std::size_t kFirstCapacity = 64;
constexpr std::size_t kMostSegments = std::numeric_limits<PoseSlot>::max() / Segment::kPoses;

void expectOneForEach(const char* what, std::size_t count, std::size_t particles) {
  if (count == particles) return;
  throw std::invalid_argument(std::string(what) + ": " + std::to_string(count) +
                              ", expected one for each of the " + std::to_string(particles) +
                              " particles");
}

}  // namespace

TrajectoryHistories::TrajectoryHistories(std::size_t particles)
    : trajectories_(new Trajectories(particles, kFirstCapacity)) {}

PoseSlot TrajectoryHistories::append(const std::vector<Pose2>& poses) {
  expectOneForEach("poses of a ping", poses.size(), particles());
  if (closed_ || lengths_.back() == Segment::kPoses) openSegment();
  const std::size_t segment = lengths_.size() - 1;
  const std::uint32_t place = lengths_.back()++;
  for (std::size_t j = 0; j < poses.size(); ++j) {
    trajectories_->segment(j, segment)->poses[place] = HistoryPose::of(poses[j]);
  }
  return static_cast<PoseSlot>(segment * Segment::kPoses + place);
}

void TrajectoryHistories::openSegment() {
  const std::size_t segment = lengths_.size();
  if (segment == kMostSegments) throw std::length_error("more trajectory segments than slots");
  if (segment == trajectories_->capacity_) {
    // a resampling in which everybody is their own ancestor makes more room
    std::vector<std::uint32_t> ancestors(particles());
    std::iota(ancestors.begin(), ancestors.end(), 0U);
    trajectories_ = prepareResampling(ancestors, state()).trajectories;
  }
  for (std::size_t j = 0; j < particles(); ++j) {
    trajectories_->segment(j, segment) = std::make_shared<Segment>();
  }
  lengths_.push_back(0);
  closed_ = false;
}

TrajectoryHistories::PreparedResampling TrajectoryHistories::prepareResampling(
    const std::vector<std::uint32_t>& ancestors, const State& state) {
  const Trajectories& before = *state.trajectories;
  expectOneForEach("ancestors", ancestors.size(), before.particles());
  for (const std::uint32_t ancestor : ancestors) {
    if (ancestor < before.particles()) continue;
    throw std::invalid_argument("ancestor " + std::to_string(ancestor) + ", expected below " +
                                std::to_string(before.particles()));
  }
  // half as much room again as is used
  const std::size_t capacity = state.segments + state.segments / 2 + kFirstCapacity;
  std::shared_ptr<Trajectories> after(new Trajectories(before.particles(), capacity));
  for (std::size_t j = 0; j < ancestors.size(); ++j) {
    const auto ancestors_first =
        before.segments_.begin() + static_cast<std::ptrdiff_t>(ancestors[j] * before.capacity_);
    std::copy_n(ancestors_first, state.segments, &after->segment(j, 0));
  }
  return {ancestors, std::move(after), state.segments};
}

void TrajectoryHistories::commitResampling(PreparedResampling prepared) {
  // there is room for the segments begun since, unless preparing has taken very long
  if (lengths_.size() >= prepared.trajectories->capacity_) {
    prepared = prepareResampling(prepared.ancestors, state());
  }
  for (; prepared.segments < lengths_.size(); ++prepared.segments) {
    for (std::size_t j = 0; j < particles(); ++j) {
      prepared.trajectories->segment(j, prepared.segments) =
          trajectories_->segment(prepared.ancestors[j], prepared.segments);
    }
  }
  trajectories_ = std::move(prepared.trajectories);
  closed_ = true;  // particles of one ancestor share the last segment: each goes on in a new one
}

std::size_t TrajectoryHistories::storedPoses() const {
  std::set<const Segment*> distinct;
  std::size_t poses = 0;
  for (std::size_t j = 0; j < particles(); ++j) {
    for (std::size_t segment = 0; segment < lengths_.size(); ++segment) {
      if (distinct.insert(trajectories_->segment(j, segment).get()).second)
        poses += lengths_[segment];
    }
  }
  return poses;
}

}  // namespace rbpf_core
