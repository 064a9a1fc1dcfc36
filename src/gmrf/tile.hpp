// What the beams say about the nodes: sums over beams, in tiles that copies of a map share.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>

#include "gmrf/cell.hpp"

namespace gmrf {

// Sums over beams of variance 1: the data's precision matrix, of which a beam touches the nodes of
// one cell, and its information vector. To be divided by the variance of a beam.
struct NodeSums {
  float self = 0.0F;           // w phi_a^2
  float along_j = 0.0F;        // w phi_a phi_b, b = a + (0, 1)
  float along_i = 0.0F;        // b = a + (1, 0)
  float along_both = 0.0F;     // b = a + (1, 1)
  float along_opposed = 0.0F;  // b = a + (1, -1)
  float information = 0.0F;    // w phi_a (z - c)
};

// The sums of the beams in 16 x 16 cells, on the 17 x 17 nodes that are their corners: nodes on a
// border have their sums in parts, one in each tile there, and a beam is never split.
struct Tile {
  static constexpr int kCells = 16;
  static constexpr int kNodes = kCells + 1;

  std::array<NodeSums, kNodes * kNodes> nodes;
  // Of the content, for nodes that exchange tiles; 0: not computed yet.
  mutable std::atomic<std::uint64_t> hash{0};

  Tile() = default;
  Tile(const Tile& other) : nodes(other.nodes) {}

  NodeSums& at(int i, int j) { return nodes[i * kNodes + j]; }
  const NodeSums& at(int i, int j) const { return nodes[i * kNodes + j]; }

  // place.cell is relative to the tile's first cell.
  void add(const CellPlace& place, double depth_m, double weight);

  std::uint64_t contentHash() const;
};

}  // namespace gmrf
