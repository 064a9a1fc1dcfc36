// Levelling of a ping and refusal of its bad beams, before anything is logged.
#pragma once

#include "rbpf_core/types.hpp"

namespace rbpf_core {

struct PingFilterParams {
  double min_range_m = 0.5;
  double max_range_m = 500.0;
  int outlier_window = 9;          // beams of the running median, odd; 0: no outlier filter
  double outlier_threshold = 8.0;  // robust standard deviations
};

// The ping's beams in the levelled body frame: x, y relative to base_link, z in map; NaN stays NaN.
Beams levelBeams(const Beams& beams_base_m, const Attitude& attitude);

// The good beams of a ping, in their order: finite, within range, and not an outlier: their z
// is within `outlier_threshold` robust standard deviations (1.4826 x the ping's median absolute
// deviation, at least 5 cm) of the running median over the neighbouring beams.
Beams goodBeams(const Ping& ping, const Attitude& attitude, const PingFilterParams& params);

}  // namespace rbpf_core
