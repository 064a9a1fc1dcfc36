// A small map of a window of pings, for other windows to be laid on: a Gaussian Markov random field
// and what it says at its nodes.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "rbpf_core/types.hpp"

namespace rbpf_core::smoothing {

class LocalMap {
 public:
  // [3, n] beams, metres, in any frame of the horizontal plane near its origin. Beams that lie off
  // the seabed are weighted down.
  explicit LocalMap(const Beams& beams_m);

  // The seabed at a place, and its slope; known: beams have been around.
  struct Look {
    bool known;
    float z_m, slope_x, slope_y;
  };
  Look at(float x_m, float y_m) const;

  // Beams that tell of the map at a place: of its corners' the fewest.
  double beamsAt(float x_m, float y_m) const;

  // h, between the nodes; 0 without beams.
  double spacing_m() const { return spacing_m_; }
  // Of a beam about the map, robust.
  double noise_std_m() const { return noise_std_m_; }

 private:
  // A place in its cell, from node (i, j) on, in parts of the spacing.
  struct InCell {
    int i, j;
    float a, b;
  };
  std::optional<InCell> cellAt(float x_m, float y_m) const;
  float z(int i, int j) const { return z_m_[static_cast<std::size_t>(i) * columns_ + j]; }

  double spacing_m_ = 0.0;
  double noise_std_m_ = 0.0;
  int first_i_ = 0, first_j_ = 0;  // node of z_m_[0]
  int rows_ = 0, columns_ = 0;
  std::vector<float> z_m_;   // [rows, columns]; NaN where no beam has been
  std::vector<float> seen_;  // [rows, columns]: beams around, by their shares
};

}  // namespace rbpf_core::smoothing
