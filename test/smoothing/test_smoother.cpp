#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <stdexcept>
#include <string>

#include "rbpf_core/smoothing/smoother.hpp"
#include "smoothed_survey.hpp"

namespace rbpf_core::smoothing {
namespace {

double rmse(const std::vector<Pose2>& poses, const std::vector<Pose2>& truth) {
  double sum = 0.0;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    sum += std::pow(poses[i].x_m - truth[i].x_m, 2) + std::pow(poses[i].y_m - truth[i].y_m, 2);
  }
  return std::sqrt(sum / static_cast<double>(poses.size()));
}

// The graph with the true relative poses of what the smoother looked at, +-0.1 m and 5 mrad.
double idealRmse(const Survey& survey, const Smoother& smoother) {
  const std::vector<Pose2> truth = truthAtNodes(survey, smoother);
  const std::vector<TrackNode>& nodes = smoother.track().nodes();
  PoseGraph graph(survey.params, nodes.front().stamp_s, nodes.front().dead_reckoning);
  for (std::size_t i = 1; i < nodes.size(); ++i) {
    graph.addNode(nodes[i].stamp_s, relative(nodes[i - 1].dead_reckoning, nodes[i].dead_reckoning));
  }
  const Eigen::Vector3d std(0.1, 0.1, 0.005);
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  for (const Closure& closure : smoother.closures()) {
    Pose2 seen = relative(truth[closure.k], truth[closure.j]);
    seen.x_m += std(0) * normal(random);
    seen.y_m += std(1) * normal(random);
    seen.yaw_rad += std(2) * normal(random);
    graph.addClosure(closure.k, closure.j, {seen, std.cwiseAbs2().asDiagonal()});
  }
  graph.solve();
  return rmse(graph.poses(), truth);
}

struct Errors {
  int accepted = 0;
  int attempts = 0;
  int beyond_3_sigma = 0;
  double chi2 = 0.0;  // sum over those accepted

  Errors& operator+=(const Errors& other) {
    accepted += other.accepted;
    attempts += other.attempts;
    beyond_3_sigma += other.beyond_3_sigma;
    chi2 += other.chi2;
    return *this;
  }
};

Errors errorsOfClosures(const Survey& survey, const Smoother& smoother) {
  const std::vector<Pose2> truth = truthAtNodes(survey, smoother);
  Errors errors;
  for (const Closure& closure : smoother.closures()) {
    ++errors.attempts;
    if (closure.registration.verdict != Verdict::kAccepted) continue;
    ++errors.accepted;
    const UncertainPose& found = closure.registration.found;
    const Pose2 seen = relative(truth[closure.k], truth[closure.j]);
    const Eigen::Vector3d d(found.pose.x_m - seen.x_m, found.pose.y_m - seen.y_m,
                            wrapAngle(found.pose.yaw_rad - seen.yaw_rad));
    const double chi2 = d.dot(found.covariance.ldlt().solve(d));
    errors.chi2 += chi2;
    // chi-squared of 3 degrees of freedom, as likely exceeded as 3 sigma of one
    if (chi2 > 14.16) ++errors.beyond_3_sigma;
  }
  return errors;
}

// Over the track, per ping: squared error over covariance, of 3 degrees of freedom.
double meanSquaredError(const Survey& survey, const Smoother& smoother) {
  const std::vector<Pose2> poses = smoother.posesOfPings();
  const std::vector<Eigen::Matrix3d> covariances = smoother.covariancesOfPings();
  double sum = 0.0;
  for (std::size_t i = 1; i < poses.size(); ++i) {
    const Eigen::Vector3d d(poses[i].x_m - survey.truth[i].x_m, poses[i].y_m - survey.truth[i].y_m,
                            wrapAngle(poses[i].yaw_rad - survey.truth[i].yaw_rad));
    sum += d.dot(covariances[i].ldlt().solve(d));
  }
  return sum / static_cast<double>(poses.size() - 1);
}

// ---- relief
// --------------------------------------------------------------------------------------

constexpr std::uint32_t kSurveys = 4;

Survey reliefSurvey(std::uint32_t seed) { return surveyOf(Seabed::relief(0.7, 10 + seed), seed); }

// Back on the first line after a long way on which the odometry has slid 30 m aside, further than
// swaths reach: by the poses alone the two passes do not meet.
TEST(SmootherOnRelief, FindsPassesThatMayBeNear) {
  constexpr double kSlide_m = 30.0;
  Survey survey = surveyOf(Seabed::relief(0.7, 3), 3, {}, {0.1, 0.02},
                           {{{0, 0}, {120, 0}}, {{120, 120}, {0, 120}}, {{0, 0}, {120, 0}}});
  for (std::size_t i = 0; i < survey.size(); ++i) {
    // while it is away
    const double slid =
        std::clamp((survey.stamps_s[i] - survey.stamps_s[0] - 100.0) / 40.0, 0.0, 1.0);
    survey.dead_reckoning[i].y_m += slid * kSlide_m;
  }
  survey.params.motion.sway_std_m = 2.0;  // 18 m in 80 s
  survey.params.motion.surge_std_m = 0.5;
  survey.params.registration.max_search_m = 40.0;
  Smoother smoother = smootherOf(survey);
  smoothAtOnce(survey, &smoother);
  EXPECT_GT(smoother.accepted(), 10U);
  const std::vector<Pose2> truth = truthAtNodes(survey, smoother);
  const std::vector<Pose2> poses = smoother.graph().poses();
  double sum = 0.0;
  for (const Closure& closure : smoother.closures()) {
    const Pose2 seen = relative(truth[closure.k], truth[closure.j]);
    const Pose2 known = relative(poses[closure.k], poses[closure.j]);
    sum += std::pow(known.x_m - seen.x_m, 2) + std::pow(known.y_m - seen.y_m, 2);
  }
  // Of 30 m. A tie is known to 1.2 m, by what the odometry may slide within the 2 s of a node.
  EXPECT_LT(std::sqrt(sum / static_cast<double>(smoother.closures().size())), 1.0);
}

void expectBookkeeping(const Survey& survey, const Smoother& smoother) {
  const std::vector<TrackNode>& nodes = smoother.track().nodes();
  std::size_t accepted = 0;
  std::size_t before = 0;
  for (const Closure& closure : smoother.closures()) {
    ASSERT_LT(closure.k, closure.j);
    ASSERT_LT(closure.j, nodes.size());
    EXPECT_GE(closure.k, 1U) << "the start has no beams";
    EXPECT_GE(closure.j, before);
    before = closure.j;
    EXPECT_EQ(closure.stamp_s, nodes[closure.j].stamp_s);
    EXPECT_EQ(closure.stamp_older_s, nodes[closure.k].stamp_s);
    EXPECT_GE(closure.stamp_s - closure.stamp_older_s, survey.params.registration.min_apart_s);
    EXPECT_STRNE(nameOf(closure.registration.verdict), "");
    if (closure.registration.verdict == Verdict::kAccepted) {
      ++accepted;
      EXPECT_GT(closure.weight, 0.0);
      EXPECT_LE(closure.weight, 1.0);
      EXPECT_GE(closure.registration.beams, 100U);
      EXPECT_GT(closure.registration.rms_m, 0.0);
      EXPECT_EQ(closure.registration.found.covariance.llt().info(), Eigen::Success);
    } else {
      EXPECT_TRUE(std::isnan(closure.weight)) << nameOf(closure.registration.verdict);
    }
  }
  EXPECT_EQ(smoother.hasClosures(), accepted > 0);
}

TEST(SmootherOnRelief, CorrectsThePast) {
  double dead_reckoning = 0.0;
  double once = 0.0;
  double again = 0.0;
  double ideal = 0.0;
  double chi2 = 0.0;
  Errors all_once;
  Errors all_again;
  for (std::uint32_t seed = 0; seed < kSurveys; ++seed) {
    SCOPED_TRACE(seed);
    const Survey survey = reliefSurvey(seed);
    Smoother smoother = smootherOf(survey);
    smoothAtOnce(survey, &smoother);
    expectBookkeeping(survey, smoother);
    dead_reckoning += std::pow(rmse(survey.dead_reckoning, survey.truth), 2);
    once += std::pow(rmse(smoother.posesOfPings(), survey.truth), 2);
    ideal += std::pow(idealRmse(survey, smoother), 2);
    chi2 += meanSquaredError(survey, smoother) / kSurveys;
    all_once += errorsOfClosures(survey, smoother);
    smoother.registerAgain();
    expectBookkeeping(survey, smoother);
    again += std::pow(rmse(smoother.posesOfPings(), survey.truth), 2);
    all_again += errorsOfClosures(survey, smoother);
  }
  // At one speed no closure tells scale nor direction of the track from odometry that is biased:
  // even the ideal keeps a third of dead reckoning's error.
  EXPECT_LT(std::sqrt(once), 0.5 * std::sqrt(dead_reckoning));
  EXPECT_LT(std::sqrt(once), 1.3 * std::sqrt(ideal));
  EXPECT_LT(std::sqrt(again), 1.15 * std::sqrt(once));
  // The errors of a track hang together, one survey is about one draw of chi-squared of 3: the mean
  // of four has a standard error of 1.2.
  EXPECT_GT(chi2, 1.0);
  EXPECT_LT(chi2, 6.0);
  // Of closures: 3 sigma are exceeded by 0.3 % of Gaussian errors.
  EXPECT_GT(all_once.accepted, 0.9 * all_once.attempts);
  EXPECT_LE(all_once.beyond_3_sigma, 0.02 * all_once.accepted);
  EXPECT_LT(all_once.chi2 / all_once.accepted, 3.0);
  EXPECT_GT(all_again.accepted, 0.9 * all_again.attempts);
  EXPECT_LE(all_again.beyond_3_sigma, 0.02 * all_again.accepted);
  EXPECT_LT(all_again.chi2 / all_again.accepted, 1.05 * all_once.chi2 / all_once.accepted);
}

TEST(SmootherOnRelief, InPiecesErrsAsAtOnce) {
  const Survey survey = reliefSurvey(0);
  Smoother at_once = smootherOf(survey);
  smoothAtOnce(survey, &at_once);
  Smoother pieces = smootherOf(survey);
  for (std::size_t i = 0; i < survey.size(); i += 70) {
    addPings(survey, i, std::min(i + 70, survey.size()), &pieces);
    pieces.update();
    ASSERT_EQ(pieces.posesOfPings().size(), std::min(i + 70, survey.size()));
  }
  pieces.finishPings();
  pieces.update();
  expectBookkeeping(survey, pieces);
  // The same windows, but for those that passes are nearest to by other poses.
  EXPECT_NEAR(static_cast<double>(pieces.closures().size()),
              static_cast<double>(at_once.closures().size()), 3.0);
  const double expected = rmse(at_once.posesOfPings(), survey.truth);
  EXPECT_NEAR(rmse(pieces.posesOfPings(), survey.truth), expected, 0.2 * expected);
  const std::size_t closures = pieces.closures().size();
  pieces.update();
  EXPECT_EQ(pieces.closures().size(), closures) << "nothing is new";
}

TEST(SmootherOnRelief, IsTheSameEachTime) {
  const Survey survey = reliefSurvey(1);
  Smoother a = smootherOf(survey);
  smoothAtOnce(survey, &a);
  Smoother b = smootherOf(survey);
  smoothAtOnce(survey, &b);
  const std::vector<Pose2> poses = a.posesOfPings();
  const std::vector<Pose2> others = b.posesOfPings();
  for (std::size_t i = 0; i < poses.size(); ++i) {
    ASSERT_EQ(poses[i].x_m, others[i].x_m) << i;
    ASSERT_EQ(poses[i].yaw_rad, others[i].yaw_rad) << i;
  }
}

// ---- what tells nothing
// --------------------------------------------------------------------------

TEST(SmootherOnAFlat, LeavesDeadReckoningAlone) {
  for (const std::uint32_t seed : {0U, 3U}) {
    const Survey survey = surveyOf(Seabed::flat(), seed);
    Smoother smoother = smootherOf(survey);
    smoothAtOnce(survey, &smoother);
    expectBookkeeping(survey, smoother);
    const Errors errors = errorsOfClosures(survey, smoother);
    EXPECT_GT(errors.attempts, 50);
    EXPECT_LE(errors.accepted, 0.05 * errors.attempts) << seed;
    EXPECT_LT(rmse(smoother.posesOfPings(), survey.truth),
              1.1 * rmse(survey.dead_reckoning, survey.truth))
        << seed;
    smoother.registerAgain();
    EXPECT_LT(rmse(smoother.posesOfPings(), survey.truth),
              1.1 * rmse(survey.dead_reckoning, survey.truth))
        << seed;
  }
}

void expectDeadReckoning(const Survey& survey, const Smoother& smoother) {
  const std::vector<Pose2> poses = smoother.posesOfPings();
  for (std::size_t i = 0; i < poses.size(); ++i) {
    ASSERT_NEAR(poses[i].x_m, survey.dead_reckoning[i].x_m, 1e-6) << i;
    ASSERT_NEAR(poses[i].y_m, survey.dead_reckoning[i].y_m, 1e-6) << i;
    ASSERT_NEAR(wrapAngle(poses[i].yaw_rad - survey.dead_reckoning[i].yaw_rad), 0.0, 1e-9) << i;
  }
}

TEST(Smoother, HasDeadReckoningBeforeItIsUpdated) {
  const Survey survey = reliefSurvey(2);
  Smoother smoother = smootherOf(survey);
  EXPECT_TRUE(smoother.posesOfPings().empty());
  smoother.update();
  smoother.registerAgain();
  EXPECT_FALSE(smoother.hasClosures());
  addPings(survey, 0, 200, &smoother);
  ASSERT_EQ(smoother.posesOfPings().size(), 200U);
  expectDeadReckoning(survey, smoother);
  const std::vector<Eigen::Matrix3d> covariances = smoother.covariancesOfPings();
  ASSERT_EQ(covariances.size(), 200U);
  EXPECT_LT(covariances[5](0, 0), covariances[100](0, 0));
  EXPECT_LT(covariances[100](0, 0), covariances[199](0, 0));
}

TEST(Smoother, LooksAtNoPassesThatAreTooNearInTime) {
  Survey survey = reliefSurvey(2);
  survey.params.registration.min_apart_s = 1e4;
  Smoother smoother = smootherOf(survey);
  smoothAtOnce(survey, &smoother);
  EXPECT_TRUE(smoother.closures().empty());
  expectDeadReckoning(survey, smoother);
}

// The first ping comes two minutes after the start, which it is near to.
TEST(Smoother, LaysNoWindowOnItselfAfterALateStart) {
  const Survey survey = reliefSurvey(2);
  Smoother smoother(survey.params, survey.stamps_s.front() - 120.0, survey.dead_reckoning.front());
  addPings(survey, 0, 100, &smoother);
  smoother.finishPings();
  smoother.update();
  EXPECT_TRUE(smoother.closures().empty());
}

// Ties err alike: errors are as large as covariances say that count them for less.
TEST(Smoother, KnowsLessThanEachOfItsTiesWouldTell) {
  const Survey survey = reliefSurvey(2);
  Smoother smoother = smootherOf(survey);
  smoothAtOnce(survey, &smoother);
  const std::size_t last = smoother.graph().size() - 1;
  const Eigen::Matrix3d known = smoother.covariances().of(last);
  EXPECT_TRUE(known.isApprox(PoseGraph::Covariances(smoother.graph(), kShareOfTies).of(last)));
  EXPECT_TRUE(known.isApprox(smoother.covariancesOfPings().back()));
  const Eigen::Matrix3d each = PoseGraph::Covariances(smoother.graph()).of(last);
  EXPECT_GT(known(0, 0) + known(1, 1), 1.5 * (each(0, 0) + each(1, 1)));
}

TEST(Smoother, StandsPassesWithoutBeams) {
  double smoothed2 = 0.0;
  double dead_reckoning2 = 0.0;
  for (const std::uint32_t seed : {3U, 4U, 5U, 6U}) {
    Survey survey = reliefSurvey(seed);
    for (std::size_t i = 0; i < 150; ++i) survey.beams_m[i].resize(3, 0);
    for (std::size_t i = 400; i < 500; ++i) survey.beams_m[i].resize(3, 0);
    Smoother smoother = smootherOf(survey);
    smoothAtOnce(survey, &smoother);
    expectBookkeeping(survey, smoother);
    smoother.registerAgain();
    expectBookkeeping(survey, smoother);
    smoothed2 += std::pow(rmse(smoother.posesOfPings(), survey.truth), 2);
    dead_reckoning2 += std::pow(rmse(survey.dead_reckoning, survey.truth), 2);
  }
  // What no beams tell of may turn a single track: of these it is a third of the squares.
  EXPECT_LT(smoothed2, 0.6 * dead_reckoning2);
}

TEST(SmootherParams, OutOfRangeAreRefusedByName) {
  const auto expectRefused = [](auto RegistrationParams::*param, auto value, const char* name) {
    SmoothingParams params;
    params.registration.*param = value;
    try {
      Smoother(params, 0.0, {});
      ADD_FAILURE() << name << " of " << value << " is taken";
    } catch (const std::invalid_argument& error) {
      EXPECT_NE(std::string(error.what()).find(name), std::string::npos) << error.what();
    }
  };
  for (const double bad : {0.0, -1.0, std::numeric_limits<double>::quiet_NaN()}) {
    expectRefused(&RegistrationParams::node_period_s, bad, "node_period_s");
    expectRefused(&RegistrationParams::window_s, bad, "window_s");
    expectRefused(&RegistrationParams::map_window_s, bad, "map_window_s");
    expectRefused(&RegistrationParams::min_apart_s, bad, "min_apart_s");
    expectRefused(&RegistrationParams::effective_beams, bad, "effective_beams");
    expectRefused(&RegistrationParams::max_search_m, bad, "max_search_m");
  }
  expectRefused(&RegistrationParams::passes, 0, "passes");
}

TEST(SmootherPings, DoNotGoBackInTime) {
  const Survey survey = reliefSurvey(2);
  Smoother smoother = smootherOf(survey);
  addPings(survey, 0, 10, &smoother);
  EXPECT_THROW(addPings(survey, 8, 9, &smoother), std::invalid_argument);
  addPings(survey, 10, 20, &smoother);
  EXPECT_EQ(smoother.posesOfPings().size(), 20U);
  expectDeadReckoning(survey, smoother);
}

}  // namespace
}  // namespace rbpf_core::smoothing
