#include <gtest/gtest.h>

#include <cmath>

#include "rbpf_core/smoothing/seabed_model.hpp"
#include "seabed.hpp"

namespace rbpf_core::smoothing {
namespace {

constexpr double kLength_m = 60.0;
constexpr double kWidth_m = 40.0;

Beams beamsOn(const Seabed& seabed, Eigen::Index beams, const Sounding& sounding) {
  return beamsAbout(seabed, {}, kLength_m, kWidth_m, beams, 1, sounding);
}

// The farthest that a plane is off the seabed in the rectangle's corners and its middle.
double errorOf(const Plane& plane, const Seabed& seabed) {
  double worst_m = std::abs(plane.at(0.0, 0.0) - seabed.z_m(0.0, 0.0));
  for (const double x : {-0.5 * kLength_m, 0.5 * kLength_m}) {
    for (const double y : {-0.5 * kWidth_m, 0.5 * kWidth_m}) {
      worst_m = std::max(worst_m, std::abs(plane.at(x, y) - seabed.z_m(x, y)));
    }
  }
  return worst_m;
}

TEST(Plane, GoesThroughTheBeams) {
  const Seabed seabed = Seabed::slope(0.2, -0.1);
  const Beams beams = beamsOn(seabed, 1000, {0.0, 0.0});
  EXPECT_LT(errorOf(Plane(beams), seabed), 1e-4) << "80 m in single precision are 4e-6 m exact";
}

TEST(Plane, IsHardlyMovedByOutliers) {
  const Seabed seabed = Seabed::slope(0.2, -0.1);
  for (const double outliers : {0.05, 0.2}) {
    // Of 2000 beams of 0.1 m a corner is known within 0.006 m; an outlier moves it as one beam of
    // two deviations at most, and they lie to both sides.
    EXPECT_LT(errorOf(Plane(beamsOn(seabed, 2000, {0.1, outliers})), seabed), 0.03) << outliers;
  }
}

TEST(Plane, StandsOneBeamAndBeamsOnALine) {
  Beams beam(3, 1);
  beam << 5.0F, -3.0F, -80.0F;
  EXPECT_NEAR(Plane(beam).at(5.0, -3.0), -80.0, 1e-6);
  EXPECT_NEAR(Plane(beam).at(50.0, 30.0), -80.0, 1e-6);
  Beams line(3, 100);
  for (int b = 0; b < 100; ++b) line.col(b) << 5.0F, 0.2F * b, -80.0F + 0.02F * b;
  EXPECT_NEAR(Plane(line).at(5.0, 30.0), -77.0, 1e-3);
  EXPECT_NEAR(Plane(line).at(15.0, 30.0), -77.0, 1e-3) << "no slope across is told";
}

// The field of cells of 1 m that the beams lie in.
double varianceOf(const Beams& beams_m, const gmrf::Model& model) {
  const Plane plane(beams_m);
  std::vector<gmrf::CellPlace> places;
  Eigen::VectorXd off_m(beams_m.cols());
  for (Eigen::Index b = 0; b < beams_m.cols(); ++b) {
    places.push_back(gmrf::cellOf(beams_m(0, b), beams_m(1, b), model.spacing_m));
    off_m(b) = beams_m(2, b) - plane.at(beams_m(0, b), beams_m(1, b));
  }
  return fieldVariance(places, off_m, model);
}

gmrf::Model cellsOf1m() {
  gmrf::Model model;
  model.spacing_m = 1.0;
  return model;
}

// A wave A sin(2 pi x / L) differs between places d apart along x by A^2 (1 - cos(2 pi d / L)) in
// the mean of squares, and along y not at all.
TEST(FieldVariance, IsThatOfTheDifferences) {
  const gmrf::Model model = cellsOf1m();
  const double length_m = 20.0;  // three of them: the plane takes none away
  for (const double height_m : {0.1, 0.5}) {
    const double difference_m2 =
        0.5 * height_m * height_m * (1.0 - std::cos(2.0 * M_PI * 2.0 / length_m));
    const double expected_m2 = difference_m2 / (2.0 * (1.0 - model.correlation(2.0)));
    for (const double noise_std_m : {0.0, 0.1}) {
      const Beams beams = beamsOn(Seabed::ripples(length_m, height_m), 24000, {noise_std_m, 0.0});
      // The means of cells take 1 % of it, edges are not counted alike; of 0.1 m a cell of ten
      // beams has 0.03 m, and of 4000 pairs the squares' sum is known within 2 % of 2 * 0.03^2.
      EXPECT_NEAR(varianceOf(beams, model) / expected_m2, 1.0, 0.1) << height_m << noise_std_m;
    }
  }
}

TEST(FieldVariance, OfNoiseAloneIsNextToNothing) {
  for (const double noise_std_m : {0.05, 0.2}) {
    const Beams beams = beamsOn(Seabed::slope(0.1, 0.05), 24000, {noise_std_m, 0.0});
    // As above: 2 % of 2 s^2 / 10, over 2 (1 - rho) = 0.11 of 2 m, five times.
    EXPECT_LT(varianceOf(beams, cellsOf1m()), 0.2 * noise_std_m * noise_std_m) << noise_std_m;
  }
}

TEST(FieldVariance, OfFewBeamsIsTheirs) {
  const Seabed seabed = Seabed::ripples(20.0, 2.0);
  const Beams beams = beamsOn(seabed, 600, {0.1, 0.0});  // one to 4 cells
  EXPECT_NEAR(varianceOf(beams, cellsOf1m()), 2.0, 0.2) << "of a sine half its square";
}

}  // namespace
}  // namespace rbpf_core::smoothing
