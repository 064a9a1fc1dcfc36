#include "gmrf/window.hpp"

#include <algorithm>
#include <limits>

namespace gmrf {

namespace {

constexpr int kFar = std::numeric_limits<int>::max();

}  // namespace

Window::Window(const std::vector<CellPlace>& places, int margin) {
  const auto [low, high] = boundsOf(places);
  rows_along_i_ = high.i - low.i >= high.j - low.j;
  first_row_ = (rows_along_i_ ? low.i : low.j) - margin;
  const int cells = rows_along_i_ ? high.i - low.i + 1 : high.j - low.j + 1;

  // Columns of each row of cells, then of the nodes within the margin.
  std::vector<std::pair<int, int>> touched(static_cast<std::size_t>(cells), {kFar, -kFar});
  for (const CellPlace& place : places) {
    const int row = (rows_along_i_ ? place.cell.i : place.cell.j) - first_row_ - margin;
    const int column = rows_along_i_ ? place.cell.j : place.cell.i;
    auto& [first, last] = touched[static_cast<std::size_t>(row)];
    first = std::min(first, column);
    last = std::max(last, column);
  }
  rows_.assign(static_cast<std::size_t>(cells + 1 + 2 * margin), {kFar, -kFar, 0});
  for (int row = 0; row < cells; ++row) {
    const auto [first, last] = touched[static_cast<std::size_t>(row)];
    if (first > last) continue;
    for (int r = row; r <= row + 1 + 2 * margin; ++r) {
      Row& nodes = rows_[static_cast<std::size_t>(r)];
      nodes.low = std::min(nodes.low, first - margin);
      nodes.high = std::max(nodes.high, last + 2 + margin);
    }
  }
  // Rows that are far from all places, between two groups of them, have no nodes.
  for (Row& row : rows_) {
    if (row.low == kFar) row = {0, 0, 0};
  }
  number();
  findEnvelope();
}

void Window::number() {
  for (std::size_t r = 0; r < rows_.size(); ++r) {
    rows_[r].first = nodes();
    const int row = first_row_ + static_cast<int>(r);
    for (int column = rows_[r].low; column < rows_[r].high; ++column) {
      node_.push_back(rows_along_i_ ? NodeIndex{row, column} : NodeIndex{column, row});
    }
  }
}

int Window::number(NodeIndex node) const {
  const int r = (rows_along_i_ ? node.i : node.j) - first_row_;
  const int column = rows_along_i_ ? node.j : node.i;
  if (r < 0 || r >= static_cast<int>(rows_.size())) return -1;
  const Row& row = rows_[static_cast<std::size_t>(r)];
  return column >= row.low && column < row.high ? row.first + column - row.low : -1;
}

// The square of the Laplacian connects nodes that are two steps apart.
void Window::findEnvelope() {
  envelope_.resize(node_.size());
  for (int n = 0; n < nodes(); ++n) {
    const NodeIndex at = node(n);
    int first = n;
    for (int di = -2; di <= 2; ++di) {
      const int reach = 2 - std::abs(di);
      for (int dj = -reach; dj <= reach; ++dj) {
        const int other = number({at.i + di, at.j + dj});
        if (other >= 0) first = std::min(first, other);
      }
    }
    envelope_[static_cast<std::size_t>(n)] = first;
  }
  for (int n = nodes() - 2; n >= 0; --n) {
    envelope_[n] = std::min(envelope_[n], envelope_[n + 1]);
  }
  for (int n = 0; n < nodes(); ++n) bandwidth_ = std::max(bandwidth_, n - envelope_[n]);
}

EnvelopeMatrix priorPrecision(const Window& window, const Model& model) {
  EnvelopeMatrix Q(window.envelope());
  const double kappa2 = model.kappa() * model.kappa();
  const double tau2 = model.precisionScale();
  for (int n = 0; n < window.nodes(); ++n) {
    // Row n of K = kappa^2 I - Laplacian; Q = tau^2 K K is a sum over its rows.
    const auto [i, j] = window.node(n);
    int columns[5] = {n};
    double values[5] = {kappa2};
    int count = 1;
    for (const NodeIndex& beside : {NodeIndex{i - 1, j}, {i, j - 1}, {i, j + 1}, {i + 1, j}}) {
      const int other = window.number(beside);
      if (other < 0) continue;
      values[0] += 1.0;
      columns[count] = other;
      values[count++] = -1.0;
    }
    for (int a = 0; a < count; ++a) {
      for (int b = 0; b < count; ++b) {
        if (columns[a] >= columns[b]) Q.at(columns[a], columns[b]) += tau2 * values[a] * values[b];
      }
    }
  }
  return Q;
}

namespace {

// Calls visit(tile, index) for every tile of which a node may be in the window.
template <typename Visit>
void forEachTile(const Window& window, const TiledSums& sums, const Visit& visit) {
  NodeBounds bounds{window.node(0), window.node(0)};
  for (int n = 1; n < window.nodes(); ++n) bounds.include(window.node(n));
  const auto [low, high] = bounds;
  // The node before a border also belongs to the tile before it.
  const TileIndex first = tileOf({low.i - 1, low.j - 1});
  const TileIndex last = tileOf(high);
  for (int i = first.i; i <= last.i; ++i) {
    for (int j = first.j; j <= last.j; ++j) {
      if (const Tile* tile = sums.find({i, j})) visit(*tile, TileIndex{i, j});
    }
  }
}

}  // namespace

WindowData addData(const Window& window, const TiledSums& sums, double beam_variance_m2,
                   EnvelopeMatrix* precision) {
  const double scale = 1.0 / beam_variance_m2;
  WindowData data{Eigen::VectorXd::Zero(window.nodes()), Eigen::VectorXd::Zero(window.nodes())};
  forEachTile(window, sums, [&](const Tile& tile, const TileIndex& index) {
    for (int a = 0; a < Tile::kNodes; ++a) {
      for (int b = 0; b < Tile::kNodes; ++b) {
        const NodeSums& node = tile.at(a, b);
        if (node.self == 0.0F) continue;
        const NodeIndex at{index.i * Tile::kCells + a, index.j * Tile::kCells + b};
        const int n = window.number(at);
        if (n >= 0) {
          precision->at(n, n) += scale * node.self;
          data.row_sums(n) += scale * node.self;
          data.information(n) += scale * node.information;
        }
        const auto connect = [&](int di, int dj, float sum) {
          if (sum == 0.0F) return;
          const int other = window.number({at.i + di, at.j + dj});
          if (n >= 0) data.row_sums(n) += scale * sum;
          if (other >= 0) data.row_sums(other) += scale * sum;
          if (n >= 0 && other >= 0) {
            precision->at(std::max(n, other), std::min(n, other)) += scale * sum;
          }
        };
        connect(0, 1, node.along_j);
        connect(1, 0, node.along_i);
        connect(1, 1, node.along_both);
        connect(1, -1, node.along_opposed);
      }
    }
  });
  return data;
}

bool hasData(const Window& window, const TiledSums& sums) {
  bool found = false;
  forEachTile(window, sums, [&](const Tile&, const TileIndex&) { found = true; });
  return found;
}

}  // namespace gmrf
