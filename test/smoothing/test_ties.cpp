#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <set>
#include <utility>
#include <vector>

#include "rbpf_core/smoothing/ties.hpp"
#include "smoothed_survey.hpp"

namespace rbpf_core::smoothing {
namespace {

constexpr std::uint32_t kSurveys = 3;

// To the end, as a survey that is over.
struct Smoothed : Smoother {
  explicit Smoothed(const Survey& survey)
      : Smoother(survey.params, survey.stamps_s.front(), survey.dead_reckoning.front()) {
    smoothAtOnce(survey, this);
    registerAgain();
  }
};

// Odometry that bends windows by more than relief is told with.
Survey reliefSurvey(std::uint32_t seed) {
  return surveyOf(Seabed::relief(0.7, 20 + seed), seed, {0.12, 0.12, 0.004}, {0.03, 0.02});
}

Eigen::Vector3d errorOf(const Pose2& relative_pose, const Pose2& k, const Pose2& j) {
  const Pose2 d = relative(relative(k, j), relative_pose);
  return {d.x_m, d.y_m, d.yaw_rad};
}

template <typename Check>
void forEachTie(const Smoother& smoother, const Check& check) {
  for (const Closure& closure : smoother.closures()) {
    for (const Tie& tie : closure.ties) check(closure, tie);
  }
}

TEST(Ties, AreOfAcceptedClosuresAndOfNodesWithinTheirWindows) {
  const Survey survey = reliefSurvey(0);
  const Smoothed smoother(survey);
  for (const Closure& closure : smoother.closures()) {
    EXPECT_EQ(closure.ties.empty(), closure.registration.verdict != Verdict::kAccepted);
  }
  forEachTie(smoother, [&](const Closure& closure, const Tie& tie) {
    const auto& nodes = smoother.track().nodes();
    const double map_window_s = survey.params.registration.map_window_s;
    EXPECT_LE(std::abs(nodes[tie.older].stamp_s - closure.stamp_older_s), map_window_s);
    EXPECT_GE(tie.newer, closure.j);
    EXPECT_LE(tie.newer, closure.j + 1);
    EXPECT_EQ(tie.relative.covariance.llt().info(), Eigen::Success);
  });
}

// Else a beam would count more than once.
TEST(Ties, TakeANodesBeamsOnceAPass) {
  const Smoothed smoother(reliefSurvey(1));
  std::set<std::pair<std::size_t, std::size_t>> seen;
  forEachTie(smoother, [&](const Closure&, const Tie& tie) {
    EXPECT_TRUE(seen.insert({tie.older, tie.newer}).second) << tie.older << ", " << tie.newer;
  });
  EXPECT_GT(seen.size(), 100U);
}

// The error over its covariance, of 3 degrees of freedom, in the mean: most directions of most
// pairs are told by few slopes or none and have hardly any error, so that less than 3 is right.
TEST(Ties, KnowTheirErrors) {
  double chi2 = 0.0;
  int ties = 0;
  int beyond_3_sigma = 0;
  for (std::uint32_t seed = 0; seed < kSurveys; ++seed) {
    const Survey survey = reliefSurvey(seed);
    const Smoothed smoother(survey);
    const std::vector<Pose2> truth = truthAtNodes(survey, smoother);
    forEachTie(smoother, [&](const Closure&, const Tie& tie) {
      const Eigen::Vector3d e = errorOf(tie.relative.pose, truth[tie.older], truth[tie.newer]);
      const double of_tie = e.dot(tie.relative.covariance.ldlt().solve(e));
      chi2 += of_tie;
      ++ties;
      if (of_tie > 14.16) ++beyond_3_sigma;  // 0.27 % of chi-squared of 3
    });
  }
  EXPECT_LT(chi2 / ties, 3.0);
  EXPECT_GT(chi2 / ties, 0.1) << "covariances that say nothing";
  EXPECT_LE(beyond_3_sigma, 0.01 * ties);
}

// What they are for: all of a survey's ties, by the graph, tell where nodes lie to each other
// better than its closures as wholes, which take the windows as rigid.
TEST(Ties, TellMoreThanWindowsAsWholes) {
  double by_ties = 0.0;
  double by_wholes = 0.0;
  for (std::uint32_t seed = 0; seed < kSurveys; ++seed) {
    const Survey survey = reliefSurvey(seed);
    const Smoothed smoother(survey);
    const std::vector<Pose2> truth = truthAtNodes(survey, smoother);
    const std::vector<TrackNode>& nodes = smoother.track().nodes();
    PoseGraph wholes(survey.params, nodes.front().stamp_s, nodes.front().dead_reckoning);
    for (std::size_t i = 1; i < nodes.size(); ++i) {
      wholes.addNode(nodes[i].stamp_s,
                     relative(nodes[i - 1].dead_reckoning, nodes[i].dead_reckoning));
    }
    for (const Closure& closure : smoother.closures()) {
      if (closure.registration.verdict != Verdict::kAccepted) continue;
      wholes.addClosure(closure.k, closure.j, closure.registration.found);
    }
    wholes.solve();
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      by_ties += errorOf(smoother.graph().pose(i), {}, truth[i]).head<2>().squaredNorm();
      by_wholes += errorOf(wholes.pose(i), {}, truth[i]).head<2>().squaredNorm();
    }
  }
  EXPECT_LT(by_ties, 0.8 * by_wholes);
}

// Along a ridge nothing tells where one is: no tie may claim it.
TEST(Ties, ClaimNothingAlongRidges) {
  const Survey survey = surveyOf(Seabed::ridges(0.7, 5), 0);
  const Smoothed smoother(survey);
  int ties = 0;
  forEachTie(smoother, [&](const Closure& closure, const Tie& tie) {
    if (closure.ties.size() == 1) return;
    // ridges lie along y of map
    const double yaw = smoother.graph().pose(tie.older).yaw_rad;
    const Eigen::Vector3d along(std::sin(yaw), std::cos(yaw), 0.0);
    EXPECT_GT(std::sqrt(along.dot(tie.relative.covariance * along)), 1.0);
    ++ties;
  });
  EXPECT_GT(ties, 100);
}

}  // namespace
}  // namespace rbpf_core::smoothing
