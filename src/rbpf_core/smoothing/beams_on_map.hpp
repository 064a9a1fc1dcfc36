// What is believed of beams that lie on a small map.
#pragma once

namespace rbpf_core::smoothing {

// Beams have a Student-t likelihood of nu degrees of freedom about the map.
constexpr double kDegreesOfFreedom = 4.0;
// The map's own error, m, which beams share.
constexpr double kMapError_m = 0.05;
// The slope that stands for nothing.
constexpr double kLeastSlope = 1e-4;

}  // namespace rbpf_core::smoothing
