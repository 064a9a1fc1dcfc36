// Levelling of a ping and refusal of its bad beams, before anything is logged.
#pragma once

#include "rbpf_core/types.hpp"

namespace rbpf_core {

// Defaults are those of config/default.yaml.
struct PingFilterParams {
  // Beams outside of this range from the sensor are refused.
  double min_range_m = 0.5;
  double max_range_m = 500.0;
  // Beams that an outlier is measured from, itself included; odd; below 3: no filter.
  int outlier_window = 9;
  // In robust standard deviations.
  double outlier_threshold = 8.0;
};

// The ping's beams in the levelled body frame: x, y relative to base_link, z in map; NaN stays NaN.
Beams levelBeams(const Beams& beams_base_m, const Attitude& attitude);

// A ping whose beams are given in the odometry's frame, with its beams in base_link; odometry: at
// the ping's stamp.
Ping inBaseLink(const Ping& ping, const Odometry& odometry);

// The good beams of a ping, in their order: finite, within range, and not an outlier. An outlier's
// z is more than `outlier_threshold` robust standard deviations (1.4826 x the median absolute
// deviation over the ping, at least 5 cm) away both from the running median of its neighbourhood
// and from the median of the depths that pairs of its neighbours give.
Beams goodBeams(const Ping& ping, const Attitude& attitude, const PingFilterParams& params);

}  // namespace rbpf_core
