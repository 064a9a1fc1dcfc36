// D_t: every beam taken in, in arrival order (the paper's Fig. 2).
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "rbpf_core/types.hpp"

namespace rbpf_core {

// A beam in the levelled body frame of its ping: x, y still to be placed by a particle's pose.
struct LoggedBeam {
  float x_m, y_m;      // levelled body frame, relative to base_link
  float z_m;           // map, the same for every particle
  std::uint32_t ping;  // index into the survey's pings, hence into every history
};

// Beams in blocks that never move once written: growth copies nothing.
class MbesLog {
 public:
  void append(std::uint32_t ping, const Beams& levelled_m);

  const LoggedBeam& operator[](std::size_t i) const {
    return blocks_[i / kBlockBeams][i % kBlockBeams];
  }
  std::size_t size() const { return size_; }

 private:
  static constexpr std::size_t kBlockBeams = std::size_t{1} << 16;
  std::vector<std::unique_ptr<LoggedBeam[]>> blocks_;
  std::size_t size_ = 0;
};

}  // namespace rbpf_core
