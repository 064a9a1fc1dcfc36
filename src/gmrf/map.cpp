#include "gmrf/map.hpp"

#include <algorithm>
#include <numeric>
#include <stdexcept>
#include <string>

#include "gmrf/window.hpp"

namespace gmrf {

namespace {

// Nodes times squared bandwidth: some milliseconds. Points that need more are predicted in parts.
constexpr double kLargestWindow = 4e6;

// Beams further than this from the reference are of no seabed, and sums of them might be infinite.
constexpr double kFarthestDepth_m = 1e6;

// What went wrong at column `i`, with its values.
template <typename Columns>
[[noreturn]] void refuse(const char* what, const Columns& columns, Eigen::Index i,
                         const char* expected) {
  std::string values;
  for (Eigen::Index k = 0; k < columns.rows(); ++k) {
    values += (k == 0 ? "" : ", ") + std::to_string(columns(k, i));
  }
  throw std::invalid_argument(std::string(what) + " " + std::to_string(i) + " is (" + values +
                              "); expected " + expected);
}

std::vector<CellPlace> placesOf(const Points& points, double spacing_m) {
  std::vector<CellPlace> places;
  places.reserve(static_cast<std::size_t>(points.cols()));
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    if (!isOnGrid(points(0, i), points(1, i), spacing_m))
      refuse("point", points, i, "finite metres, near the survey");
    places.push_back(cellOf(points(0, i), points(1, i), spacing_m));
  }
  return places;
}

// Predicts some of the points from one window, or from several if that is too large.
class Predictor {
 public:
  Predictor(const Map& map, const FieldModel& field, Variances variances,
            const std::vector<CellPlace>& places, Prediction* prediction)
      : map_(map), field_(field), variances_(variances), places_(places), out_(*prediction) {}

  void predict(std::vector<std::size_t> points) {
    std::vector<CellPlace> places;
    places.reserve(points.size());
    for (const std::size_t p : points) places.push_back(places_[p]);
    if (isTooWide(places)) return predictHalves(std::move(points));
    const Window window(places, kMargin);
    const double cost = 1.0 * window.nodes() * window.bandwidth() * window.bandwidth();
    if (cost > kLargestWindow && points.size() > 1 && spread(places) > 0) {
      return predictHalves(std::move(points));
    }
    predictFrom(window, points);
  }

 private:
  static double spread(const std::vector<CellPlace>& places) {
    const auto [low, high] = boundsOf(places);
    return std::max(1.0 * high.i - low.i, 1.0 * high.j - low.j);
  }
  // A window is not even laid out over points that are far from each other.
  static bool isTooWide(const std::vector<CellPlace>& places) { return spread(places) > 1000.0; }

  void predictHalves(std::vector<std::size_t> points) {
    std::vector<CellPlace> places;
    for (const std::size_t p : points) places.push_back(places_[p]);
    const auto [low, high] = boundsOf(places);
    const bool along_i = 1.0 * high.i - low.i >= 1.0 * high.j - low.j;
    const double middle = along_i ? 0.5 * (1.0 * low.i + high.i) : 0.5 * (1.0 * low.j + high.j);
    const auto second = std::partition(points.begin(), points.end(), [&](std::size_t p) {
      return (along_i ? places_[p].cell.i : places_[p].cell.j) <= middle;
    });
    std::vector<std::size_t> rest(second, points.end());
    points.erase(second, points.end());
    predict(std::move(points));
    predict(std::move(rest));
  }

  void predictFrom(const Window& window, const std::vector<std::size_t>& points) {
    const Model& model = field_.model();
    if (!hasData(window, map_.sums())) {
      for (const std::size_t p : points) set(p, map_.reference_m(), model.outputscale_m2);
      return;
    }
    EnvelopeMatrix A = priorPrecision(window, model);
    WindowData data = addData(window, map_.sums(), field_.beamVariance(), &A);
    // Nodes outside the window are taken to have the mean depth of the beams in it, m: about that
    // the field is found. The prior's mean stays where it is: Q 1 = tau^2 kappa^4 1.
    const double weight = data.row_sums.sum();
    const double local_m = weight > 0.0 ? data.information.sum() / weight : 0.0;
    const double kappa2 = model.kappa() * model.kappa();
    Eigen::VectorXd x = data.information - local_m * data.row_sums;
    x.array() -= model.precisionScale() * kappa2 * kappa2 * local_m;
    A.factorise();
    A.solve(&x);
    const double level_m = map_.reference_m() + local_m;
    if (variances_ == Variances::kNone) {
      for (const std::size_t p : points) set(p, level_m + at(window, places_[p], x), 0.0);
      return;
    }
    const EnvelopeMatrix S = A.inverse();
    for (const std::size_t p : points) {
      const CellPlace& place = places_[p];
      const double variance =
          varianceAt(window, place, S) + field_.discretisation().at(place.fx, place.fy);
      set(p, level_m + at(window, place, x), std::min(variance, model.outputscale_m2));
    }
  }

  static std::array<int, 4> corners(const Window& window, const NodeIndex& cell) {
    return {window.number(cell), window.number({cell.i, cell.j + 1}),
            window.number({cell.i + 1, cell.j}), window.number({cell.i + 1, cell.j + 1})};
  }
  static double at(const Window& window, const CellPlace& place, const Eigen::VectorXd& x) {
    const auto n = corners(window, place.cell);
    const CornerWeights phi = cornerWeights(place.fx, place.fy);
    return phi[0] * x(n[0]) + phi[1] * x(n[1]) + phi[2] * x(n[2]) + phi[3] * x(n[3]);
  }
  static double varianceAt(const Window& window, const CellPlace& place, const EnvelopeMatrix& S) {
    const auto n = corners(window, place.cell);
    const CornerWeights phi = cornerWeights(place.fx, place.fy);
    double sum = 0.0;
    for (int a = 0; a < 4; ++a) {
      for (int b = 0; b < 4; ++b) {
        sum += phi[a] * phi[b] * S.at(std::max(n[a], n[b]), std::min(n[a], n[b]));
      }
    }
    return sum;
  }
  void set(std::size_t point, double mean_m, double variance_m2) {
    const auto p = static_cast<Eigen::Index>(point);
    out_.mean_m(p) = mean_m;
    out_.variance_m2(p) = variance_m2;
  }

  const Map& map_;
  const FieldModel& field_;
  const Variances variances_;
  const std::vector<CellPlace>& places_;
  Prediction& out_;
};

}  // namespace

Map::Map(double spacing_m, double reference_m) : spacing_m_(spacing_m), reference_m_(reference_m) {
  if (!(spacing_m > 0.0) || !std::isfinite(spacing_m) || !std::isfinite(reference_m)) {
    throw std::invalid_argument("map has a spacing of " + std::to_string(spacing_m) +
                                " m and a reference of " + std::to_string(reference_m) +
                                " m; expected finite numbers, the spacing above 0");
  }
}

Map Map::share() {
  Map twin(spacing_m_, reference_m_);
  twin.sums_ = sums_.share();
  return twin;
}

void Map::expectGood(const Beams& beams, const Eigen::VectorXd& weights) const {
  if (weights.size() != beams.cols()) {
    throw std::invalid_argument(std::to_string(weights.size()) + " weights; expected " +
                                std::to_string(beams.cols()) + ", one for each beam");
  }
  for (Eigen::Index i = 0; i < beams.cols(); ++i) {
    const bool near = isOnGrid(beams(0, i), beams(1, i), spacing_m_) &&
                      std::abs(beams(2, i) - reference_m_) < kFarthestDepth_m;
    if (!near) refuse("beam", beams, i, "finite metres, near the survey");
    if (!(weights(i) >= 0.0 && weights(i) <= 1.0))
      refuse("weight", weights.transpose(), i, "0 to 1");
  }
}

void Map::foldGood(const Beams& beams, const Eigen::VectorXd& weights) {
  for (Eigen::Index i = 0; i < beams.cols(); ++i) {
    const CellPlace place = cellOf(beams(0, i), beams(1, i), spacing_m_);
    sums_.add(place, beams(2, i) - reference_m_, weights(i));
  }
}

Prediction Map::predict(const Points& points, const FieldModel& field, Variances variances) const {
  if (field.model().spacing_m != spacing_m_) {
    throw std::invalid_argument("model has a spacing of " +
                                std::to_string(field.model().spacing_m) + " m; expected " +
                                std::to_string(spacing_m_) + " m, the map's");
  }
  Prediction prediction{Eigen::VectorXd(points.cols()), Eigen::VectorXd(points.cols())};
  if (points.cols() == 0) return prediction;
  const std::vector<CellPlace> places = placesOf(points, spacing_m_);
  std::vector<std::size_t> all(places.size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  Predictor(*this, field, variances, places, &prediction).predict(std::move(all));
  return prediction;
}

Points Map::nodesWithData() const {
  std::vector<Eigen::Vector2d> nodes;
  for (const TiledSums::Entry& entry : sums_.entries()) {
    // The last row and column are the next tile's first, or have no cells of their own.
    for (int a = 0; a < Tile::kCells; ++a) {
      for (int b = 0; b < Tile::kCells; ++b) {
        if (entry.tile->at(a, b).self == 0.0F) continue;
        nodes.emplace_back(spacing_m_ * (entry.index.i * Tile::kCells + a),
                           spacing_m_ * (entry.index.j * Tile::kCells + b));
      }
    }
  }
  Points points(2, static_cast<Eigen::Index>(nodes.size()));
  for (std::size_t i = 0; i < nodes.size(); ++i)
    points.col(static_cast<Eigen::Index>(i)) = nodes[i];
  return points;
}

Points Map::tileMiddles() const {
  Points middles(2, static_cast<Eigen::Index>(sums_.entries().size()));
  Eigen::Index t = 0;
  for (const TiledSums::Entry& entry : sums_.entries()) {
    middles.col(t++) << entry.index.i + 0.5, entry.index.j + 0.5;
  }
  return Tile::kCells * spacing_m_ * middles;
}

}  // namespace gmrf
