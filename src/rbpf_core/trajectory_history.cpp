#include "rbpf_core/trajectory_history.hpp"

#include <algorithm>
#include <limits>
#include <set>
#include <stdexcept>
#include <string>

namespace rbpf_core {

namespace {

constexpr std::size_t kFirstCapacity = 64;  // segments a particle
constexpr std::size_t kMostSegments = std::numeric_limits<PoseSlot>::max() / Segment::kPoses;

void expectOneForEach(const char* what, std::size_t count, std::size_t particles) {
  if (count == particles) return;
  throw std::invalid_argument(std::string(what) + ": " + std::to_string(count) +
                              ", expected one for each of the " + std::to_string(particles) +
                              " particles");
}

}  // namespace

TrajectoryHistories::TrajectoryHistories(std::size_t particles)
    : pasts_(new Pasts(particles, kFirstCapacity)) {}

PoseSlot TrajectoryHistories::append(const std::vector<Pose2>& poses) {
  expectOneForEach("poses of a ping", poses.size(), particles());
  if (closed_ || lengths_.back() == Segment::kPoses) openSegment();
  const std::size_t segment = lengths_.size() - 1;
  const std::uint32_t place = lengths_.back()++;
  for (std::size_t j = 0; j < poses.size(); ++j) {
    pasts_->segment(j, segment)->poses[place] = HistoryPose::of(poses[j]);
  }
  return static_cast<PoseSlot>(segment * Segment::kPoses + place);
}

void TrajectoryHistories::openSegment() {
  const std::size_t segment = lengths_.size();
  if (segment == kMostSegments) throw std::length_error("more trajectory segments than slots");
  if (segment == pasts_->capacity_) {
    // nobody resampled: everyone is one's own heir, with more room
    std::vector<std::uint32_t> ancestors(particles());
    for (std::uint32_t j = 0; j < ancestors.size(); ++j) ancestors[j] = j;
    pasts_ = heirs(ancestors, now()).pasts;
  }
  for (std::size_t j = 0; j < particles(); ++j) {
    pasts_->segment(j, segment) = std::make_shared<Segment>();
  }
  lengths_.push_back(0);
  closed_ = false;
}

TrajectoryHistories::Heirs TrajectoryHistories::heirs(const std::vector<std::uint32_t>& ancestors,
                                                      const Stand& stand) {
  const Pasts& before = *stand.pasts;
  expectOneForEach("ancestors", ancestors.size(), before.particles());
  for (const std::uint32_t ancestor : ancestors) {
    if (ancestor < before.particles()) continue;
    throw std::invalid_argument("ancestor " + std::to_string(ancestor) + ", expected below " +
                                std::to_string(before.particles()));
  }
  // half as much room again as is used
  const std::size_t capacity = stand.segments + stand.segments / 2 + kFirstCapacity;
  std::shared_ptr<Pasts> after(new Pasts(before.particles(), capacity));
  for (std::size_t j = 0; j < ancestors.size(); ++j) {
    const auto past =
        before.segments_.begin() + static_cast<std::ptrdiff_t>(ancestors[j] * before.capacity_);
    std::copy_n(past, stand.segments, &after->segment(j, 0));
  }
  return {ancestors, std::move(after), stand.segments};
}

void TrajectoryHistories::succeed(Heirs heirs) {
  // unless the heirs have been made over many segments, there is room for those begun since
  if (lengths_.size() >= heirs.pasts->capacity_) {
    heirs = TrajectoryHistories::heirs(heirs.ancestors, now());
  }
  for (; heirs.segments < lengths_.size(); ++heirs.segments) {
    for (std::size_t j = 0; j < particles(); ++j) {
      heirs.pasts->segment(j, heirs.segments) = pasts_->segment(heirs.ancestors[j], heirs.segments);
    }
  }
  pasts_ = std::move(heirs.pasts);
  closed_ = true;  // several heirs may share the last segment: each goes on in one of its own
}

std::size_t TrajectoryHistories::storedPoses() const {
  std::set<const Segment*> distinct;
  std::size_t poses = 0;
  for (std::size_t j = 0; j < particles(); ++j) {
    for (std::size_t segment = 0; segment < lengths_.size(); ++segment) {
      if (distinct.insert(pasts_->segment(j, segment).get()).second) poses += lengths_[segment];
    }
  }
  return poses;
}

}  // namespace rbpf_core
