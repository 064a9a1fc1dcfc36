// Beams that lie off the seabed are found by the map itself.
#pragma once

#include "gmrf/map.hpp"

namespace gmrf {

// Weights of a block of beams that a map is about to take in: those of a Student-t likelihood,
//   w = (nu + 1) / (nu + r^2 / s^2), at most 1,
// of the residual r about the map with the block taken in, found by iteration. A beam that fits has
// a weight of 1.
Eigen::VectorXd robustWeights(Map& map, const FieldModel& field, const Beams& beams);

}  // namespace gmrf
