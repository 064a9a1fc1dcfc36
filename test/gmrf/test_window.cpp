#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <limits>
#include <random>
#include <stdexcept>

#include "dense_field.hpp"
#include "gmrf/window.hpp"

namespace gmrf {
namespace {

// ---- EnvelopeMatrix against Eigen's dense matrices ---------------------------------------------

// Rows reach back by different numbers of columns, some not at all.
const std::vector<int> kEnvelope = {0, 0, 0, 2, 2, 2,  3,  7,  7,  7,
                                    8, 8, 8, 8, 9, 10, 10, 12, 18, 18};

struct Both {
  EnvelopeMatrix envelope;
  Eigen::MatrixXd dense;
};

Both randomMatrix(std::vector<int> envelope) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  Both both{EnvelopeMatrix(envelope), {}};
  const int n = both.envelope.size();
  both.dense = Eigen::MatrixXd::Zero(n, n);
  for (int r = 0; r < n; ++r) {
    for (int c = envelope[static_cast<std::size_t>(r)]; c <= r; ++c) {
      const double value = uniform(random) + (c == r ? 6.0 : 0.0);
      both.envelope.at(r, c) = both.dense(r, c) = both.dense(c, r) = value;
    }
  }
  return both;
}

void expectDenseAlgebra(Both both, const std::vector<int>& envelope) {
  const int n = both.envelope.size();
  const Eigen::LLT<Eigen::MatrixXd> dense(both.dense);
  ASSERT_EQ(dense.info(), Eigen::Success);
  both.envelope.factorise();

  const double log_determinant = 2.0 * dense.matrixLLT().diagonal().array().log().sum();
  EXPECT_NEAR(both.envelope.logDeterminant(), log_determinant, 1e-9);  // n rounded logarithms

  Eigen::VectorXd x = Eigen::VectorXd::LinSpaced(n, -1.0, 2.0);
  const Eigen::VectorXd expected = dense.solve(x);
  both.envelope.solve(&x);
  // Double precision times a condition of up to 1e4.
  EXPECT_TRUE(x.isApprox(expected, 1e-10));

  const EnvelopeMatrix inverse = both.envelope.inverse();
  const Eigen::MatrixXd expected_inverse = dense.solve(Eigen::MatrixXd::Identity(n, n));
  const double tolerance = 1e-10 * expected_inverse.cwiseAbs().maxCoeff();
  for (int r = 0; r < n; ++r) {
    for (int c = envelope[static_cast<std::size_t>(r)]; c <= r; ++c) {
      EXPECT_NEAR(inverse.at(r, c), expected_inverse(r, c), tolerance) << r << ", " << c;
    }
  }
}

TEST(EnvelopeMatrix, AgreesWithDenseAlgebra) {
  expectDenseAlgebra(randomMatrix(kEnvelope), kEnvelope);
  expectDenseAlgebra(randomMatrix({0}), {0});
}

// Long enough for whatever works on many entries at a time.
TEST(EnvelopeMatrix, AgreesWithDenseAlgebraOnAWindow) {
  Points points(2, 30);
  for (int i = 0; i < 30; ++i) points.col(i) << 0.5 + i, 0.5 + 0.4 * i;
  const Window window(placesOf(points, 1.0), 3);
  const Model model{1.0, 8.0, 2.0, 0.01};
  expectDenseAlgebra({priorPrecision(window, model), densePrecision(nodesOf(window), model)},
                     window.envelope());
}

TEST(EnvelopeMatrix, SaysWhereItIsNotPositiveDefinite) {
  for (const double spoilt : {-0.1, std::nan("")}) {
    Both both = randomMatrix(kEnvelope);
    both.envelope.at(11, 11) = spoilt;
    EXPECT_THROW(both.envelope.factorise(), std::domain_error) << spoilt;
  }
}

// ---- the prior ---------------------------------------------------------------------------------

struct Shape {
  const char* name;
  Points points;
};

std::vector<Shape> shapes() {
  Shape rectangle{"rectangle", cellsOf(5, 7, 1.0)};
  rectangle.points.row(1).array() -= 3.0;
  Shape diagonal{"diagonal", Points(2, 12)};
  for (int k = 0; k < 12; ++k) diagonal.points.col(k) << 0.3 + 0.7 * k, -4.6 + 1.1 * k;
  Shape apart{"two groups", Points(2, 4)};
  apart.points << 0.5, 1.5, 2.5, 2.5, 30.5, 30.5, -0.5, 0.5;
  return {rectangle, diagonal, apart};
}

TEST(Window, HoldsEveryCellAndTheMarginAroundIt) {
  constexpr int kWide = 3;
  for (const auto& [name, points] : shapes()) {
    const std::vector<CellPlace> places = placesOf(points, 1.0);
    const Window window(places, kWide);
    for (const CellPlace& place : places) {
      for (int di = -kWide; di <= 1 + kWide; ++di) {
        for (int dj = -kWide; dj <= 1 + kWide; ++dj) {
          const NodeIndex node{place.cell.i + di, place.cell.j + dj};
          const int number = window.number(node);
          ASSERT_GE(number, 0) << name;
          EXPECT_EQ(window.node(number).i, node.i) << name;
          EXPECT_EQ(window.node(number).j, node.j) << name;
        }
      }
    }
    EXPECT_EQ(window.number({1000, 1000}), -1) << name;
  }
}

TEST(PriorPrecision, IsTheSquareOfTheOperatorOnAnyWindow) {
  const Model model{2.0, 9.0, 1.7, 0.01};
  for (const auto& [name, points] : shapes()) {
    const Window window(placesOf(points, 1.0), 2);
    const EnvelopeMatrix Q = priorPrecision(window, model);
    const Eigen::MatrixXd expected = densePrecision(nodesOf(window), model);
    for (int r = 0; r < window.nodes(); ++r) {
      const int first = window.envelope()[static_cast<std::size_t>(r)];
      for (int c = 0; c <= r; ++c) {
        const double value = c < first ? 0.0 : Q.at(r, c);
        EXPECT_NEAR(value, expected(r, c), 1e-12) << name << ": " << r << ", " << c;
      }
    }
  }
}

// In the middle of a window that reaches 2.5 lengthscales further, where its edges are not felt.
TEST(PriorPrecision, IsThatOfAMaternField) {
  constexpr int kNodes = 41;
  const Model model{1.0, 8.0, 3.0, 0.01};
  const Window window(placesOf(cellsOf(kNodes - 1, kNodes - 1, 1.0), 1.0), 0);
  EnvelopeMatrix Q = priorPrecision(window, model);
  Q.factorise();
  constexpr int kMiddle = kNodes / 2;
  Eigen::VectorXd covariance = Eigen::VectorXd::Zero(window.nodes());
  covariance(window.number({kMiddle, kMiddle})) = 1.0;
  Q.solve(&covariance);
  const auto at = [&](int di, int dj) {
    return covariance(window.number({kMiddle + di, kMiddle + dj}));
  };
  // The grid's field differs from the continuous one by some tenths of kappa^2, 0.125 here.
  EXPECT_NEAR(at(0, 0), model.outputscale_m2, 0.08 * model.outputscale_m2);
  EXPECT_NEAR(at(8, 0) / at(0, 0), 0.14, 0.02);
  // s K1(s), s = sqrt(8) r / l
  for (const int r : {2, 4, 8, 12}) {
    const double s = std::sqrt(8.0) * r / model.lengthscale_m;
    EXPECT_NEAR(at(r, 0) / at(0, 0), s * std::cyl_bessel_k(1.0, s), 0.04) << r;
    EXPECT_NEAR(at(0, -r), at(r, 0), 1e-9) << r;
  }
}

// ---- what the grid cannot represent ------------------------------------------------------------

TEST(DiscretisationVariance, IsNoneAtTheNodesAndLargestInTheMiddleOfACell) {
  const DiscretisationVariance variance(Model{2.0, 15.0, 1.5, 0.01});
  for (const double fx : {0.0, 1.0}) {
    for (const double fy : {0.0, 1.0}) EXPECT_NEAR(variance.at(fx, fy), 0.0, 1e-12);
  }
  const double middle = variance.at(0.5, 0.5);
  double sum = 0.0;
  for (int i = 0; i < 20; ++i) {
    for (int j = 0; j < 20; ++j) {
      const double fx = (i + 0.5) / 20.0;
      const double fy = (j + 0.5) / 20.0;
      EXPECT_LT(variance.at(fx, fy), middle);
      EXPECT_GT(variance.at(fx, fy), 0.0);
      EXPECT_NEAR(variance.at(fx, fy), variance.at(fy, 1.0 - fx), 1e-12);  // a quarter turn
      sum += variance.at(fx, fy);
    }
  }
  EXPECT_GT(variance.mean(), 0.0);
  EXPECT_LT(variance.mean(), middle);
  EXPECT_NEAR(sum / 400.0, variance.mean(), 0.01 * middle);  // two rules of integration
}

TEST(DiscretisationVariance, IsOfTheMaternCovariance) {
  const Model model{2.0, 15.0, 1.5, 0.01};
  const auto k = [&](double r_m) {
    const double s = std::sqrt(8.0) * r_m / model.lengthscale_m;
    return model.outputscale_m2 * (r_m == 0.0 ? 1.0 : s * std::cyl_bessel_k(1.0, s));
  };
  // In the middle every corner has the weight 1/4 and the distance h / sqrt(2).
  const double between = 0.25 * (k(0.0) + 2.0 * k(2.0) + k(2.0 * M_SQRT2));
  const double expected = k(0.0) - 2.0 * k(M_SQRT2) + between;
  EXPECT_NEAR(DiscretisationVariance(model).at(0.5, 0.5), expected, 1e-12);
}

TEST(DiscretisationVariance, GrowsWithTheSpacing) {
  double before = 0.0;
  for (const double spacing_m : {0.5, 1.0, 2.0, 4.0}) {
    const double mean = DiscretisationVariance(Model{spacing_m, 15.0, 1.5, 0.01}).mean();
    EXPECT_GT(mean, before);
    before = mean;
  }
}

TEST(Model, RefusesWhatIsNotAboveZero) {
  for (const double bad : {0.0, -1.0, std::nan(""), std::numeric_limits<double>::infinity()}) {
    EXPECT_THROW((Model{bad, 15.0, 1.5, 0.01}.check()), std::invalid_argument) << bad;
    EXPECT_THROW((Model{2.0, bad, 1.5, 0.01}.check()), std::invalid_argument) << bad;
    EXPECT_THROW((Model{2.0, 15.0, bad, 0.01}.check()), std::invalid_argument) << bad;
    EXPECT_THROW((Model{2.0, 15.0, 1.5, bad}.check()), std::invalid_argument) << bad;
    EXPECT_THROW(FieldModel(Model{2.0, 15.0, 1.5, bad}), std::invalid_argument) << bad;
  }
}

}  // namespace
}  // namespace gmrf
