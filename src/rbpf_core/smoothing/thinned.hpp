// Fewer beams that still cover the same ground.
#pragma once

#include "rbpf_core/types.hpp"

namespace rbpf_core::smoothing {

// `wanted` beams of [3, n] at equal distances in their order; all, if there are no more.
inline Beams thinned(const Beams& beams_m, Eigen::Index wanted) {
  const Eigen::Index n = beams_m.cols();
  if (n <= wanted) return beams_m;
  Beams out(3, wanted);
  for (Eigen::Index i = 0; i < wanted; ++i) out.col(i) = beams_m.col(i * n / wanted);
  return out;
}

}  // namespace rbpf_core::smoothing
