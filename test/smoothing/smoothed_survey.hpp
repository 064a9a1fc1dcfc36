// A small survey in the smoother's hands.
#pragma once

#include <cstddef>
#include <vector>

#include "rbpf_core/smoothing/smoother.hpp"
#include "survey.hpp"

namespace rbpf_core::smoothing {

inline Smoother smootherOf(const Survey& survey) {
  return {survey.params, survey.stamps_s.front(), survey.dead_reckoning.front()};
}

inline void addPings(const Survey& survey, std::size_t first, std::size_t last,
                     Smoother* smoother) {
  for (std::size_t i = first; i < last; ++i) {
    smoother->addPing(survey.stamps_s[i], survey.dead_reckoning[i], survey.beams_m[i]);
  }
}

inline void smoothAtOnce(const Survey& survey, Smoother* smoother) {
  addPings(survey, 0, survey.size(), smoother);
  smoother->finishPings();
  smoother->update();
}

// The truth at the nodes: a node is a ping, but for the start.
inline std::vector<Pose2> truthAtNodes(const Survey& survey, const Smoother& smoother) {
  std::vector<Pose2> truth{survey.truth.front()};
  const std::vector<PingPlace>& pings = smoother.track().pings();
  const std::vector<TrackNode>& nodes = smoother.track().nodes();
  for (std::size_t i = 0; i < pings.size() && truth.size() < nodes.size(); ++i) {
    if (pings[i].stamp_s == nodes[truth.size()].stamp_s) truth.push_back(survey.truth[i]);
  }
  return truth;
}

}  // namespace rbpf_core::smoothing
