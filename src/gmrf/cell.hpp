// Grid cells: where a point lies, and the bilinear weights of the corners around it.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

namespace gmrf {

// Nodes are at whole multiples of the spacing; a cell is called by its lower corner.
struct NodeIndex {
  std::int32_t i, j;
};

struct NodeBounds {
  NodeIndex low, high;  // both within

  void include(const NodeIndex& node) {
    low = {std::min(low.i, node.i), std::min(low.j, node.j)};
    high = {std::max(high.i, node.i), std::max(high.j, node.j)};
  }
};

// phi of the corners (0, 0), (0, 1), (1, 0), (1, 1).
using CornerWeights = std::array<double, 4>;

inline CornerWeights cornerWeights(double fx, double fy) {
  return {(1.0 - fx) * (1.0 - fy), (1.0 - fx) * fy, fx * (1.0 - fy), fx * fy};
}

struct CellPlace {
  NodeIndex cell;
  double fx, fy;  // [0, 1)
};

// Of all cells; there must be one.
inline NodeBounds boundsOf(const std::vector<CellPlace>& places) {
  NodeBounds bounds{places.front().cell, places.front().cell};
  for (const CellPlace& place : places) bounds.include(place.cell);
  return bounds;
}

// Beyond this many nodes from the origin there is no map: 1e8 of them are 1e5 km at a spacing of
// 1 m.
constexpr double kFarthestNode = 1e8;

inline bool isOnGrid(double x_m, double y_m, double spacing_m) {
  const double limit_m = kFarthestNode * spacing_m;
  return std::abs(x_m) < limit_m && std::abs(y_m) < limit_m;  // false for NaN
}

inline CellPlace cellOf(double x_m, double y_m, double spacing_m) {
  const double u = x_m / spacing_m;
  const double v = y_m / spacing_m;
  const double i = std::floor(u);
  const double j = std::floor(v);
  return {{static_cast<std::int32_t>(i), static_cast<std::int32_t>(j)}, u - i, v - j};
}

}  // namespace gmrf
