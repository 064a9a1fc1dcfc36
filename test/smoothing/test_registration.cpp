#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <random>
#include <vector>

#include "rbpf_core/smoothing/registration.hpp"
#include "seabed.hpp"

namespace rbpf_core::smoothing {
namespace {

// As the smoother's: 28 s and 12 s of a swath of 40 m at 2 m/s.
constexpr double kWidth_m = 40.0;
constexpr double kMapLength_m = 56.0;
constexpr double kWindowLength_m = 24.0;
constexpr Eigen::Index kMapBeams = 7000;
constexpr Eigen::Index kWindowBeams = 3000;

UncertainPose expectedAt(const Pose2& pose, double std_m, double std_rad) {
  return {pose, Eigen::Vector3d(std_m * std_m, std_m * std_m, std_rad * std_rad).asDiagonal()};
}

LocalMap mapOn(const Seabed& seabed, std::uint32_t seed, const Sounding& sounding = {}) {
  return LocalMap(beamsAbout(seabed, {}, kMapLength_m, kWidth_m, kMapBeams, seed, sounding));
}

// Every third beam is registered, as the smoother does.
WindowOfPings windowOn(const Seabed& seabed, const Pose2& pose, std::uint32_t seed,
                       const Sounding& sounding = {}) {
  const Beams beams =
      beamsAbout(seabed, pose, kWindowLength_m, kWidth_m, kWindowBeams, seed + 1000, sounding);
  Beams third(3, kWindowBeams / 3);
  for (Eigen::Index b = 0; b < third.cols(); ++b) third.col(b) = beams.col(3 * b);
  return {third, LocalMap(beams)};
}

Eigen::Vector3d difference(const Pose2& a, const Pose2& b) {
  return {a.x_m - b.x_m, a.y_m - b.y_m, wrapAngle(a.yaw_rad - b.yaw_rad)};
}

double chiSquared(const UncertainPose& found, const Pose2& truth) {
  const Eigen::Vector3d d = difference(found.pose, truth);
  return d.dot(found.covariance.ldlt().solve(d));
}

// Drawn from what is expected, about the truth.
Pose2 drawn(const Pose2& truth, double std_m, double std_rad, std::mt19937* random) {
  std::normal_distribution<double> normal;
  const double dx = std_m * normal(*random);
  const double dy = std_m * normal(*random);
  return {truth.x_m + dx, truth.y_m + dy, wrapAngle(truth.yaw_rad + std_rad * normal(*random))};
}

// ---- relief ------------------------------------------------------------------------------------

struct Outcome {
  int accepted = 0;
  int beyond_3_sigma = 0;
  double chi2 = 0.0;   // mean of those accepted
  double rms_m = 0.0;  // of their distances
  double rms_rad = 0.0;
};

constexpr int kTrials = 40;

Outcome registerOnRelief(double relief_m, const Sounding& sounding, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  Outcome outcome;
  for (std::uint32_t trial = 0; trial < kTrials; ++trial) {
    const Seabed seabed = Seabed::relief(relief_m, seed + trial);
    // Any heading, as lines cross; half the width over.
    const Pose2 truth{10.0 * uniform(random), 10.0 * uniform(random), M_PI * uniform(random)};
    const Registration r = registerWindow(
        mapOn(seabed, seed + trial, sounding), windowOn(seabed, truth, seed + trial, sounding),
        expectedAt(drawn(truth, 3.0, 0.02, &random), 3.0, 0.02), {});
    if (r.verdict != Verdict::kAccepted) continue;
    ++outcome.accepted;
    const double chi2 = chiSquared(r.found, truth);
    const Eigen::Vector3d d = difference(r.found.pose, truth);
    // chi-squared of 3 degrees of freedom, as likely exceeded as 3 sigma of one
    if (chi2 > 14.16) ++outcome.beyond_3_sigma;
    outcome.chi2 += chi2;
    outcome.rms_m += d.head<2>().squaredNorm();
    outcome.rms_rad += d.z() * d.z();
  }
  outcome.chi2 /= outcome.accepted;
  outcome.rms_m = std::sqrt(outcome.rms_m / outcome.accepted);
  outcome.rms_rad = std::sqrt(outcome.rms_rad / outcome.accepted);
  return outcome;
}

// As the smoother's registrations: the errors are those of beams which are independent here, a
// thousand instead of the forty that they count for.
void expectSound(const Outcome& outcome) {
  EXPECT_GE(outcome.accepted, 0.95 * kTrials);
  EXPECT_LE(outcome.beyond_3_sigma, 0.02 * kTrials);  // none
  // Of 3 degrees of freedom: 3 if the beams were forty, 0.1 if all were told apart.
  EXPECT_GT(outcome.chi2, 0.05);
  EXPECT_LT(outcome.chi2, 1.0);
}

TEST(RegistrationOnRelief, FindsShiftsAndTurns) {
  const Outcome outcome = registerOnRelief(1.0, {}, 100);
  expectSound(outcome);
  // A thousand beams of 0.1 m on slopes of 0.2 leave 0.02 m; the map's own errors are shared.
  EXPECT_LT(outcome.rms_m, 0.1);
  EXPECT_LT(outcome.rms_rad, 0.005);
}

TEST(RegistrationOnRelief, FindsThemOnALittleRelief) {
  const Outcome outcome = registerOnRelief(0.25, {}, 200);
  expectSound(outcome);
  EXPECT_LT(outcome.rms_m, 0.4);  // a quarter of the slopes
  EXPECT_LT(outcome.rms_rad, 0.02);
}

TEST(RegistrationOnRelief, FindsThemAmongOutliers) {
  const Outcome outcome = registerOnRelief(1.0, {0.1, 0.05}, 300);
  expectSound(outcome);
  EXPECT_LT(outcome.rms_m, 0.12);
  EXPECT_LT(outcome.rms_rad, 0.006);
}

// ---- what tells too little ---------------------------------------------------------------------

const Pose2 kTruth{4.0, -3.0, 0.4};

// Each from another place that is drawn from what is expected, and on other beams.
std::vector<Registration> registrations(const Seabed& there, const Seabed& here, double std_m,
                                        int trials, const Pose2& truth = kTruth) {
  std::mt19937 random(7);
  std::vector<Registration> all;
  for (int trial = 0; trial < trials; ++trial) {
    const auto seed = static_cast<std::uint32_t>(trial);
    all.push_back(registerWindow(mapOn(there, seed), windowOn(here, truth, seed),
                                 expectedAt(drawn(truth, std_m, 0.01, &random), std_m, 0.01), {}));
  }
  return all;
}

TEST(Registration, RefusesAFlat) {
  for (const Registration& r : registrations(Seabed::flat(), Seabed::flat(), 2.0, 12)) {
    EXPECT_STREQ(nameOf(r.verdict), "flat");
  }
}

// Along y there is nothing to tell places apart: large there, small in the direction that is known
// best, which noise may turn a little off x.
void expectKnownAcrossOnly(const Registration& r) {
  ASSERT_STREQ(nameOf(r.verdict), "accepted");
  const Eigen::Matrix2d position = r.found.covariance.topLeftCorner<2, 2>();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen(position);
  EXPECT_GT(std::sqrt(position(1, 1)), 50.0);  // wider than a window
  EXPECT_LT(std::sqrt(eigen.eigenvalues()(0)), 0.5);
  EXPECT_GT(std::abs(eigen.eigenvectors()(0, 0)), 0.99);
  EXPECT_NEAR(r.found.pose.x_m, kTruth.x_m, 0.2);
  EXPECT_LT(chiSquared(r.found, kTruth), 14.16);
}

TEST(Registration, KnowsOnlyAcrossAStraightSlope) {
  const Seabed slope = Seabed::slope(0.1, 0.0);
  for (const Registration& r : registrations(slope, slope, 2.0, 8)) expectKnownAcrossOnly(r);
}

TEST(Registration, KnowsOnlyAcrossRidges) {
  const Seabed ridges = Seabed::ridges(1.0, 5);
  for (const Registration& r : registrations(ridges, ridges, 2.0, 8)) expectKnownAcrossOnly(r);
}

// Along its contours beams fit everywhere, up to their noise, which is not to be followed: what is
// laid far off is tied to the relief of another place. A third of the windows lies on the map.
TEST(Registration, StaysWhereItIsExpectedAlongAStraightSlope) {
  const Seabed slope = Seabed::slope(0.1, 0.0);
  const Pose2 truth{0.0, 25.0, 0.0};
  constexpr double kStd_m = 1.0;
  constexpr int kWindows = 12;
  double squares = 0.0;
  for (std::uint32_t seed = 0; seed < kWindows; ++seed) {
    const Registration r = registerWindow(mapOn(slope, seed), windowOn(slope, truth, seed),
                                          expectedAt(truth, kStd_m, 0.01), {});
    ASSERT_STREQ(nameOf(r.verdict), "accepted");
    squares += std::pow(r.found.pose.y_m - truth.y_m, 2);
  }
  EXPECT_LT(std::sqrt(squares / kWindows), 1.5 * kStd_m);  // by the beams alone it is 1.9
}

// Of ten metres: others lie within an expectation of 6 m, and not within one of 1 m.
TEST(Registration, DoesNotChooseBetweenRipples) {
  const Seabed ripples = Seabed::ripples(10.0, 0.4);
  for (const Registration& r : registrations(ripples, ripples, 6.0, 16)) {
    EXPECT_STREQ(nameOf(r.verdict), "ambiguous");
  }
}

TEST(Registration, StaysOnTheRippleThatIsMeant) {
  const Seabed ripples = Seabed::ripples(10.0, 0.4);
  for (const Registration& r : registrations(ripples, ripples, 1.0, 12)) expectKnownAcrossOnly(r);
}

// Of some hundred places that are looked at, one may by chance have slopes along one direction as
// the window has them: they pass at a correlation of 0.3, so that a relief of 0.1 m tells
// something.
TEST(Registration, RefusesAnotherSeabed) {
  int accepted = 0;
  for (std::uint32_t seed = 0; seed < 40; ++seed) {
    const Registration r =
        registrations(Seabed::relief(1.0, 20 + seed), Seabed::relief(1.0, 150 + seed), 3.0, 1)
            .front();
    if (r.verdict == Verdict::kAccepted) ++accepted;
  }
  EXPECT_LE(accepted, 2);
}

// Of a window that is expected so far ahead of where it is.
Registration registeredOffBy(double off_m, double std_m, const Seabed& seabed) {
  Pose2 far = kTruth;
  far.x_m += off_m;
  return registerWindow(mapOn(seabed, 1), windowOn(seabed, kTruth, 1), expectedAt(far, std_m, 0.01),
                        {});
}

// Off the place where it is expected by far more than it may be.
TEST(Registration, RefusesAPlaceThatIsNotExpected) {
  const Registration r = registeredOffBy(1.5, 0.1, Seabed::relief(1.0, 5));
  EXPECT_NE(r.verdict, Verdict::kAccepted);
}

// By five standard deviations, as after a current that nobody knows of.
TEST(Registration, TakesAPlaceOffTheExpectedOneIfItIsTheOnlyOneFarAround) {
  const Registration r = registeredOffBy(2.0, 0.4, Seabed::relief(1.0, 5));
  EXPECT_STREQ(nameOf(r.verdict), "accepted");
  EXPECT_NEAR(r.found.pose.x_m, kTruth.x_m, 0.3);
  EXPECT_NEAR(r.found.pose.y_m, kTruth.y_m, 0.3);
}

TEST(Registration, DoesNotTakeARippleOffTheExpectedPlace) {
  const Seabed ripples = Seabed::ripples(10.0, 0.4);
  for (const double off_m : {-4.6, 4.6}) {
    const Registration r = registeredOffBy(off_m, 1.0, ripples);
    EXPECT_STREQ(nameOf(r.verdict), "ambiguous") << off_m;
  }
}

TEST(Registration, RefusesLittleOverlap) {
  const Seabed seabed = Seabed::relief(1.0, 5);
  for (const double aside_m : {34.0, 60.0}) {
    for (const Registration& r : registrations(seabed, seabed, 1.0, 4, {0.0, aside_m, 0.0})) {
      EXPECT_STREQ(nameOf(r.verdict), "little_overlap") << aside_m;
      EXPECT_LT(r.beams, 250U);
    }
  }
}

TEST(Registration, TakesHalfAnOverlap) {
  const Seabed seabed = Seabed::relief(1.0, 5);
  const Pose2 aside{0.0, 20.0, 0.0};
  for (const Registration& r : registrations(seabed, seabed, 1.0, 4, aside)) {
    EXPECT_STREQ(nameOf(r.verdict), "accepted");
    EXPECT_LT(chiSquared(r.found, aside), 14.16);
  }
}

TEST(Registration, RefusesTooFewBeams) {
  const Seabed seabed = Seabed::relief(1.0, 5);
  const UncertainPose expected = expectedAt(kTruth, 1.0, 0.01);
  const LocalMap map = mapOn(seabed, 1);
  const Beams few = beamsAbout(seabed, kTruth, kWindowLength_m, kWidth_m, 99, 1);
  const LocalMap nothing(Beams(3, 0));
  for (const Registration& r :
       {registerWindow(map, {few, LocalMap(few)}, expected, {}),
        registerWindow(map, {Beams(3, 0), nothing}, expected, {}),
        registerWindow(nothing, windowOn(seabed, kTruth, 1), expected, {})}) {
    EXPECT_STREQ(nameOf(r.verdict), "little_overlap");
    EXPECT_EQ(r.found.pose.x_m, kTruth.x_m) << "where it is expected";
  }
}

TEST(Registration, SearchesNoFurtherThanItIsTold) {
  const Seabed seabed = Seabed::relief(1.0, 5);
  Pose2 far = kTruth;
  far.x_m += 18.0;
  RegistrationParams params;
  const WindowOfPings window = windowOn(seabed, kTruth, 1);
  const UncertainPose expected = expectedAt(far, 10.0, 0.01);
  const Registration within = registerWindow(mapOn(seabed, 1), window, expected, params);
  EXPECT_STREQ(nameOf(within.verdict), "accepted");
  EXPECT_NEAR(within.found.pose.x_m, kTruth.x_m, 0.3);
  params.max_search_m = 5.0;
  const Registration beyond = registerWindow(mapOn(seabed, 1), window, expected, params);
  EXPECT_NE(beyond.verdict, Verdict::kAccepted);
}

}  // namespace
}  // namespace rbpf_core::smoothing
