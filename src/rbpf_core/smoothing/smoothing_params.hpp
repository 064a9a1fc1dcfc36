// What the smoother is told. Defaults are those of config/default.yaml, and its comments there.
#pragma once

#include "rbpf_core/motion_model.hpp"

namespace rbpf_core::smoothing {

// Half lengths of the windows, and what makes a closure. docs/closures.md has the formulas.
struct RegistrationParams {
  // Between the nodes of the graph, s of survey.
  double node_period_s = 2.0;
  // Of the window that is registered, and of the older one that its map is made of; each way, s.
  double window_s = 6.0;
  double map_window_s = 14.0;
  // Between both, at least.
  double min_apart_s = 60.0;
  // Passes that a window is registered to, at most.
  int passes = 3;
  // A window counts as so many independent beams.
  double effective_beams = 40.0;
  // Largest distance that is searched, m.
  double max_search_m = 25.0;
};

struct SmoothingParams {
  MotionNoise motion;
  // Standard deviations of the odometry's biases, and the time after which they are forgotten.
  double velocity_bias_std_mps = 0.02;
  double yaw_bias_std_radps = 5e-5;
  // Of either component of a current that the odometry does not measure.
  double current_std_mps = 0.003;
  double bias_time_s = 3600.0;
  // Of the start.
  double start_position_std_m = 0.0;
  double start_yaw_std_rad = 0.0;
  RegistrationParams registration;
};

}  // namespace rbpf_core::smoothing
