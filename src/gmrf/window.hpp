// A part of the grid around some points, and the field on it: prior and data as a banded matrix.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "gmrf/envelope_matrix.hpp"
#include "gmrf/model.hpp"
#include "gmrf/tiled_sums.hpp"

namespace gmrf {

// Nodes in rows, of which each has its own range of columns: so a window follows a swath that lies
// across the grid. Rows run along the axis in which the points extend further: the band is narrow.
class Window {
 public:
  // All cells of the places, and `margin` nodes around each. Expects at least one place.
  Window(const std::vector<CellPlace>& places, int margin);

  int nodes() const { return static_cast<int>(node_.size()); }
  // Largest distance between the numbers of two nodes that the prior connects.
  int bandwidth() const { return bandwidth_; }

  // A node's number; -1 outside.
  int number(NodeIndex node) const;
  NodeIndex node(int number) const { return node_[static_cast<std::size_t>(number)]; }
  // First number that a node is connected to.
  const std::vector<int>& envelope() const { return envelope_; }

 private:
  struct Row {
    int low, high;  // columns [low, high)
    int first;      // number of the node at low
  };

  void number();
  void findEnvelope();

  bool rows_along_i_;
  int first_row_;
  std::vector<Row> rows_;
  std::vector<NodeIndex> node_;
  std::vector<int> envelope_;
  int bandwidth_ = 0;
};

// Q = tau^2 (kappa^2 I - Laplacian)^2 on a window, with Neumann edges.
EnvelopeMatrix priorPrecision(const Window& window, const Model& model);

// The data on a window: information vector and, for each node, the sum of its row of the data's
// precision matrix, which counts its neighbours outside the window too. Both are divided by a
// beam's variance.
struct WindowData {
  Eigen::VectorXd information;
  Eigen::VectorXd row_sums;
};

// Adds the data's precision matrix to the prior's.
WindowData addData(const Window& window, const TiledSums& sums, double beam_variance_m2,
                   EnvelopeMatrix* precision);

// Whether any beam has been in the tiles that a window touches.
bool hasData(const Window& window, const TiledSums& sums);

}  // namespace gmrf
