#include <gtest/gtest.h>

#include <Eigen/Cholesky>

#include "dense_field.hpp"
#include "gmrf/evidence.hpp"
#include "gmrf/robust_weights.hpp"

namespace gmrf {
namespace {

double slopeWithRipples(double x_m, double y_m) {
  return -50.0 + 0.3 * std::sin(0.6 * x_m + 0.2 * y_m) + 0.1 * y_m;
}

// ---- evidence ----------------------------------------------------------------------------------

double denseLogEvidence(const Sample& sample, const Model& model) {
  const Points points = sample.beams.topRows<2>();
  const Window window(placesOf(points, model.spacing_m), kMarginOfSample);
  const std::vector<NodeIndex> nodes = nodesOf(window);
  const Eigen::MatrixXd phi = denseInterpolation(nodes, points, model.spacing_m);
  Eigen::MatrixXd covariance =
      phi * densePrecision(nodes, model).llt().solve(Eigen::MatrixXd(phi.transpose()));
  covariance.diagonal().array() += FieldModel(model).beamVariance() / sample.weights.array();
  const Eigen::VectorXd z = sample.beams.row(2);
  const double mean = sample.weights.dot(z) / sample.weights.sum();
  const Eigen::LLT<Eigen::MatrixXd> factor(covariance);
  const Eigen::VectorXd white = factor.matrixL().solve((z.array() - mean).matrix());
  return -0.5 * white.squaredNorm() - factor.matrixLLT().diagonal().array().log().sum() -
         0.5 * static_cast<double>(z.size()) * std::log(2.0 * M_PI);
}

TEST(LogEvidence, IsTheDensityOfADenseNormalDistribution) {
  const Beams beams = beamsOn(slopeWithRipples, evenPoints(60, 9.0, 7.0, 1), 0.1, 2);
  const Sample sample{beams, Eigen::VectorXd::LinSpaced(60, 0.05, 1.0)};
  for (const Model& model :
       {Model{1.5, 8.0, 1.0, 0.01}, Model{1.5, 30.0, 0.2, 0.05}, Model{1.0, 4.0, 3.0, 0.001}}) {
    // Sums of up to 1e5 in single precision.
    EXPECT_NEAR(logEvidence(sample, model), denseLogEvidence(sample, model), 0.01);
  }
}

TEST(LogEvidence, DoesNotDependOnTheDepth) {
  Sample sample{beamsOn(slopeWithRipples, evenPoints(60, 9.0, 7.0, 1), 0.1, 2),
                Eigen::VectorXd::Ones(60)};
  const Model model{1.5, 8.0, 1.0, 0.01};
  const double before = logEvidence(sample, model);
  sample.beams.row(2).array() -= 3000.0;
  EXPECT_NEAR(logEvidence(sample, model), before, 1e-3);  // single precision
}

TEST(MostEvident, RecoversTheModelOfADrawnSeabed) {
  const Model truth{1.0, 12.0, 2.0, 0.3 * 0.3};
  std::vector<Sample> samples;
  for (const std::uint32_t seed : {1, 2}) {
    const DrawnSeabed seabed(40.0, 20.0, truth, -50.0, seed);
    const auto depth = [&](double x_m, double y_m) { return seabed.at(x_m, y_m); };
    const Beams beams = beamsOn(depth, evenPoints(1500, 40.0, 20.0, 10 + seed), 0.3, 20 + seed);
    samples.push_back({beams, fullWeights(beams)});
  }
  const Model found = mostEvident(samples, Model{1.0, 25.0, 1.0, 0.01});
  EXPECT_EQ(found.spacing_m, 1.0);
  // The noise shows in every pair of beams, but what the grid cannot represent, a fifth of it here,
  // is no noise between beams of one cell. l and o show only in the few lengthscales of the area.
  EXPECT_NEAR(std::log(found.noise_variance_m2 / truth.noise_variance_m2), 0.0, std::log(1.3));
  EXPECT_NEAR(std::log(found.lengthscale_m / truth.lengthscale_m), 0.0, std::log(1.5));
  EXPECT_NEAR(std::log(found.outputscale_m2 / truth.outputscale_m2), 0.0, std::log(2.0));
}

TEST(MostEvident, RefusesAModelThatIsNone) {
  EXPECT_THROW(mostEvident({}, Model{1.0, -1.0, 1.0, 0.01}), std::invalid_argument);
}

// ---- robust weights ----------------------------------------------------------------------------

const FieldModel& field() {
  static const FieldModel model(Model{1.0, 12.0, 1.0, 0.01});
  return model;
}

// Block by block, as a map gets them, with the weights that each block has.
Map robustMap(const Beams& beams) {
  constexpr Eigen::Index kBlock = 500;
  Map map(1.0, -50.0);
  for (Eigen::Index first = 0; first < beams.cols(); first += kBlock) {
    const Beams block = beams.middleCols(first, kBlock);
    map.fold(block, robustWeights(map, field(), block));
  }
  return map;
}

// A swath of 20 m along 50 m: blocks follow each other.
Points swath() {
  Points places = evenPoints(3000, 50.0, 20.0, 3);
  for (Eigen::Index i = 0; i < places.cols(); ++i) places(0, i) = 50.0 / 3000.0 * i;
  return places;
}

double rmse(const Map& map) {
  const Points points = evenPoints(1000, 50.0, 20.0, 4);
  const Beams truth = beamsOn(slopeWithRipples, points, 0.0, 1);
  const Prediction prediction = map.predict(points, field(), Variances::kNone);
  return std::sqrt((prediction.mean_m.transpose() - truth.row(2)).squaredNorm() / 1000.0);
}

TEST(RobustWeights, KeepOutliersFromHurting) {
  const Beams clean = beamsOn(slopeWithRipples, swath(), 0.1, 5);
  Beams spoilt = clean;
  std::mt19937 random(6);
  std::uniform_real_distribution<double> offset_m(-10.0, 10.0);
  for (Eigen::Index i = 0; i < spoilt.cols(); ++i) {
    if (random() % 20 == 0) spoilt(2, i) += offset_m(random);
  }
  const double without = rmse(robustMap(clean));
  EXPECT_LT(rmse(robustMap(spoilt)), 1.2 * without);
  Map trusting(1.0, -50.0);
  trusting.fold(spoilt, fullWeights(spoilt));
  EXPECT_GT(rmse(trusting), 2.0 * without) << "these outliers are none";
}

TEST(RobustWeights, AreOneForBeamsThatFit) {
  Map map = robustMap(beamsOn(slopeWithRipples, swath(), 0.1, 5));
  Beams beams = beamsOn(slopeWithRipples, evenPoints(100, 50.0, 20.0, 7), 0.1, 8);
  Beams exact = beams.leftCols(1);
  exact(2, 0) = slopeWithRipples(exact(0, 0), exact(1, 0));
  beams.col(0) = exact;
  beams(2, 1) += 5.0;
  const Eigen::VectorXd weights = robustWeights(map, field(), beams);
  ASSERT_EQ(weights.size(), 100);
  EXPECT_GT(weights(0), 0.99);
  // (nu + 1) / (nu + (5 / 0.1)^2), and the scale is some tenths above the noise
  EXPECT_LT(weights(1), 0.005);
  EXPECT_GT(weights(1), 0.0);
  EXPECT_LE(weights.maxCoeff(), 1.0);
  // Of a normal distribution two thirds lie within a standard deviation, and have 1.
  EXPECT_GT(weights.tail(98).mean(), 0.85);
}

TEST(RobustWeights, LeaveTheMapAlone) {
  Map map(1.0, -50.0);
  EXPECT_EQ(robustWeights(map, field(), Beams(3, 0)).size(), 0);
  robustWeights(map, field(), beamsOn(slopeWithRipples, evenPoints(100, 50.0, 20.0, 7), 0.1, 8));
  EXPECT_TRUE(map.sums().entries().empty());
}

}  // namespace
}  // namespace gmrf
