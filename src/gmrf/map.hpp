// One map of the seabed: a Gaussian Markov random field and what the beams have said about it.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <vector>

#include "gmrf/model.hpp"
#include "gmrf/tiled_sums.hpp"

namespace gmrf {

// x, y, z of beams, or x, y of points, one column each; metres. x and y count from an origin near
// the survey, z is upwards.
using Beams = Eigen::Matrix3Xd;
using Points = Eigen::Matrix2Xd;

// A model and what follows from it: the same for all maps of a node.
class FieldModel {
 public:
  // Throws as Model::check.
  explicit FieldModel(const Model& model)
      : model_((model.check(), model)), discretisation_(model) {}

  const Model& model() const { return model_; }
  const DiscretisationVariance& discretisation() const { return discretisation_; }
  // Of a beam about the nodes' interpolation.
  double beamVariance() const { return model_.noise_variance_m2 + discretisation_.mean(); }

 private:
  const Model model_;
  const DiscretisationVariance discretisation_;
};

struct Prediction {
  Eigen::VectorXd mean_m;
  // Latent: of the seabed, a beam's noise not included. Never above the outputscale.
  Eigen::VectorXd variance_m2;
};

// Which variances are wanted: each costs about twice what the mean does.
enum class Variances { kAll, kNone };

// Used by one thread at a time; copies, which share what they have in common, by others.
class Map {
 public:
  // spacing_m: that of every model it is asked under; reference_m: what depths count from, the
  // mean of the field.
  Map(double spacing_m, double reference_m);
  Map(Map&&) = default;
  Map& operator=(Map&&) = default;

  Map share();

  // Takes beams in, each with a weight: 1 for a good one, less for a doubtful one. The sums do not
  // depend on the model but for its spacing: a model may be exchanged at any time. Beams that are
  // not finite or too far away, and weights beyond 0 to 1, are refused before any is taken in, by
  // std::invalid_argument.
  void fold(const Beams& beams, const Eigen::VectorXd& weights) {
    expectGood(beams, weights);
    foldGood(beams, weights);
  }
  // The same in two parts.
  void expectGood(const Beams& beams, const Eigen::VectorXd& weights) const;
  void foldGood(const Beams& beams, const Eigen::VectorXd& weights);

  // Points that are not finite or too far away are refused by std::invalid_argument.
  Prediction predict(const Points& points, const FieldModel& field,
                     Variances variances = Variances::kAll) const;

  // Where the nodes are that beams have said something about; and the middles of the tiles.
  Points nodesWithData() const;
  Points tileMiddles() const;

  double spacing_m() const { return spacing_m_; }
  double reference_m() const { return reference_m_; }
  const TiledSums& sums() const { return sums_; }
  TiledSums& sums() { return sums_; }

 private:
  double spacing_m_;
  double reference_m_;
  TiledSums sums_;
};

// Nodes around a window's points beyond which the seabed is left out of account: see docs/gmrf.md
// for the error that this makes.
constexpr int kMargin = 4;

}  // namespace gmrf
