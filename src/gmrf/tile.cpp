#include "gmrf/tile.hpp"

#include "gmrf/hash.hpp"

namespace gmrf {

void Tile::add(const CellPlace& place, double depth_m, double weight) {
  const CornerWeights phi = cornerWeights(place.fx, place.fy);
  const auto [p00, p01, p10, p11] = phi;
  NodeSums& n00 = at(place.cell.i, place.cell.j);
  NodeSums& n01 = at(place.cell.i, place.cell.j + 1);
  NodeSums& n10 = at(place.cell.i + 1, place.cell.j);
  NodeSums& n11 = at(place.cell.i + 1, place.cell.j + 1);
  const auto single = [](double value) { return static_cast<float>(value); };
  n00.self += single(weight * p00 * p00);
  n01.self += single(weight * p01 * p01);
  n10.self += single(weight * p10 * p10);
  n11.self += single(weight * p11 * p11);
  n00.along_j += single(weight * p00 * p01);
  n10.along_j += single(weight * p10 * p11);
  n00.along_i += single(weight * p00 * p10);
  n01.along_i += single(weight * p01 * p11);
  n00.along_both += single(weight * p00 * p11);
  n01.along_opposed += single(weight * p01 * p10);
  const double information = weight * depth_m;
  n00.information += single(p00 * information);
  n01.information += single(p01 * information);
  n10.information += single(p10 * information);
  n11.information += single(p11 * information);
}

std::uint64_t Tile::contentHash() const {
  std::uint64_t value = hash.load(std::memory_order_relaxed);
  if (value == 0) {
    value = hashOf(nodes.data(), sizeof(nodes)) | 1U;  // never 0
    hash.store(value, std::memory_order_relaxed);
  }
  return value;
}

}  // namespace gmrf
