// D_t: every beam taken in, in arrival order (the paper's Fig. 2).
#pragma once

#include "rbpf_core/append_only.hpp"
#include "rbpf_core/trajectory_history.hpp"
#include "rbpf_core/types.hpp"

namespace rbpf_core {

// A beam in the levelled body frame of its ping: x, y still to be placed by a particle's pose.
struct LoggedBeam {
  float x_m, y_m;  // levelled body frame, relative to base_link
  float z_m;       // map, the same for every particle
  PoseSlot slot;   // of its ping's pose, in every particle's trajectory
};

class MbesLog {
 public:
  // The beams of one ping.
  void append(PoseSlot slot, const Beams& levelled_m);

  const LoggedBeam& operator[](std::size_t i) const { return beams_[i]; }
  std::size_t size() const { return beams_.size(); }  // for the writer only

 private:
  AppendOnly<LoggedBeam, std::size_t{1} << 16> beams_;  // 1 MB a block
};

}  // namespace rbpf_core
