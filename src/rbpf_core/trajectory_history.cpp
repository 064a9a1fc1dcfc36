#include "rbpf_core/trajectory_history.hpp"

#include <algorithm>
#include <limits>
#include <set>
#include <stdexcept>
#include <string>
#include <unordered_map>

namespace rbpf_core {

namespace {

// Segments that each particle has room for at first.
constexpr std::size_t kFirstCapacity = 64;
constexpr std::size_t kMostSegments = std::numeric_limits<PoseSlot>::max() / Segment::kPoses;

// Half as much again as is used.
std::size_t capacityFor(std::size_t segments) { return segments + segments / 2 + kFirstCapacity; }

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
    trajectories_ = withCapacity(*trajectories_, capacityFor(segment));
  }
  for (std::size_t j = 0; j < particles(); ++j) {
    trajectories_->segment(j, segment) = std::make_shared<Segment>();
  }
  lengths_.push_back(0);
  closed_ = false;
}

std::shared_ptr<Trajectories> TrajectoryHistories::withCapacity(const Trajectories& before,
                                                                std::size_t capacity) {
  std::shared_ptr<Trajectories> after(new Trajectories(before.particles(), capacity));
  const std::size_t segments = std::min(before.capacity_, capacity);
  for (std::size_t j = 0; j < before.particles(); ++j) {
    std::copy_n(before.segments_.begin() + static_cast<std::ptrdiff_t>(j * before.capacity_),
                segments, &after->segment(j, 0));
  }
  return after;
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
  std::shared_ptr<Trajectories> after(
      new Trajectories(before.particles(), capacityFor(state.segments)));
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

// Particles that have shared a segment share the one that is made of it.
TrajectoryHistories::PreparedCorrection TrajectoryHistories::prepareCorrection(
    const std::vector<RigidMotion>& of_slot, const RigidMotion& of_rest, const State& state) {
  const Trajectories& before = *state.trajectories;
  std::shared_ptr<Trajectories> after(
      new Trajectories(before.particles(), capacityFor(state.segments)));
  std::unordered_map<const Segment*, std::shared_ptr<Segment>> moved;
  for (std::size_t number = 0; number < state.segments; ++number) {
    const std::size_t length =
        number + 1 == state.segments ? state.last_length : std::size_t{Segment::kPoses};
    const std::size_t first_slot = number * Segment::kPoses;
    moved.clear();
    for (std::size_t j = 0; j < before.particles(); ++j) {
      const Segment& old = *before.segments_[j * before.capacity_ + number];
      std::shared_ptr<Segment>& made = moved[&old];
      if (!made) {
        made = std::make_shared<Segment>();
        for (std::size_t k = 0; k < length; ++k) {
          const std::size_t slot = first_slot + k;
          made->poses[k] = move(slot < of_slot.size() ? of_slot[slot] : of_rest, old.poses[k]);
        }
      }
      after->segment(j, number) = made;
    }
  }
  return {of_rest, std::move(after), state.segments, state.last_length};
}

void TrajectoryHistories::commitCorrection(PreparedCorrection prepared) {
  if (lengths_.size() > prepared.trajectories->capacity_) {
    prepared.trajectories = withCapacity(*prepared.trajectories, capacityFor(lengths_.size()));
  }
  Trajectories& after = *prepared.trajectories;
  const auto bringIn = [&](std::size_t number, std::size_t from) {
    for (std::size_t j = 0; j < particles(); ++j) {
      std::shared_ptr<Segment>& made = after.segment(j, number);
      if (!made) made = std::make_shared<Segment>();
      const Segment& old = *trajectories_->segment(j, number);
      for (std::size_t k = from; k < lengths_[number]; ++k) {
        made->poses[k] = move(prepared.of_rest, old.poses[k]);
      }
    }
  };
  // No two particles share what has been appended since: there was no resampling.
  if (prepared.segments > 0) bringIn(prepared.segments - 1, prepared.last_length);
  for (std::size_t number = prepared.segments; number < lengths_.size(); ++number) {
    bringIn(number, 0);
  }
  trajectories_ = std::move(prepared.trajectories);
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
