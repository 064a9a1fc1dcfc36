#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <functional>
#include <limits>
#include <numeric>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "rbpf_core/random.hpp"
#include "rbpf_core/resampling.hpp"

namespace rbpf_core {
namespace {

using Counts = std::vector<std::uint32_t>;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
const double kAlmostOne = std::nextafter(1.0, 0.0);

Eigen::ArrayXd arrayOf(const std::vector<double>& values) {
  return Eigen::Map<const Eigen::ArrayXd>(values.data(), static_cast<Eigen::Index>(values.size()));
}

std::size_t sum(const Counts& counts) {
  return std::accumulate(counts.begin(), counts.end(), std::size_t{0});
}

Eigen::ArrayXd randomWeights(Eigen::Index particles, RandomStream& stream) {
  Eigen::ArrayXd weights(particles);
  // cubes: a few heavy particles and many light ones
  for (double& weight : weights) weight = std::pow(stream.uniform(), 3);
  return weights / weights.sum();
}

// ---- weights -----------------------------------------------------------------------------------

TEST(NormalisedWeights, AreTheExponentialsOverTheirSum) {
  const Eigen::ArrayXd weights = normalisedWeights(arrayOf({0.0, std::log(2.0), std::log(5.0)}));
  EXPECT_NEAR(weights(0), 1.0 / 8.0, 1e-15);
  EXPECT_NEAR(weights(1), 2.0 / 8.0, 1e-15);
  EXPECT_NEAR(weights(2), 5.0 / 8.0, 1e-15);
}

TEST(NormalisedWeights, DoNotUnderflowOrOverflow) {
  for (const double offset : {-1e5, 1e5, -1e12}) {
    const Eigen::ArrayXd weights = normalisedWeights(arrayOf({offset, offset + 1.0}));
    // 1e-4: the spacing of doubles at 1e12
    EXPECT_NEAR(weights(1) / weights(0), std::exp(1.0), 1e-3);
    EXPECT_NEAR(weights.sum(), 1.0, 1e-15);
  }
}

TEST(NormalisedWeights, LetAParticleVanish) {
  const Eigen::ArrayXd weights = normalisedWeights(arrayOf({-kInfinity, -3.0, -1e6}));
  // vectorised exponentials may stop just above zero
  EXPECT_LT(weights(0), 1e-300);
  EXPECT_EQ(weights(1), 1.0);
  EXPECT_LT(weights(2), 1e-300);
}

TEST(NormalisedWeights, RefuseNaNAndInfinity) {
  const double nan = std::nan("");
  EXPECT_THROW(normalisedWeights(arrayOf({0.0, nan, -1.0})), std::domain_error);
  EXPECT_THROW(normalisedWeights(arrayOf({nan, 0.0})), std::domain_error);
  EXPECT_THROW(normalisedWeights(arrayOf({0.0, kInfinity})), std::domain_error);
  EXPECT_THROW(normalisedWeights(arrayOf({-kInfinity, -kInfinity})), std::domain_error);
}

TEST(EffectiveParticles, IsARealNumberBetweenOneAndJ) {
  EXPECT_NEAR(effectiveParticles(Eigen::ArrayXd::Constant(40, 1.0 / 40.0)), 40.0, 1e-12);
  EXPECT_DOUBLE_EQ(effectiveParticles(arrayOf({0.0, 1.0, 0.0})), 1.0);
  EXPECT_NEAR(effectiveParticles(arrayOf({0.5, 0.3, 0.2})), 1.0 / 0.38, 1e-15);  // 2.63
  EXPECT_NEAR(effectiveParticles(arrayOf({0.9, 0.1})), 1.0 / 0.82, 1e-15);       // 1.22
}

// ---- systematic resampling ---------------------------------------------------------------------

TEST(SystematicOffspring, FollowsTheCombOfItsOneDraw) {
  // cumulated J w: 0.4, 2.0, 3.6, 4.0; teeth 0.3, 1.3, 2.3, 3.3
  EXPECT_EQ(systematicOffspring(arrayOf({0.1, 0.4, 0.4, 0.1}), 0.3), (Counts{1, 1, 2, 0}));
  // teeth 0.5, 1.5, 2.5, 3.5
  EXPECT_EQ(systematicOffspring(arrayOf({0.1, 0.4, 0.4, 0.1}), 0.5), (Counts{0, 2, 2, 0}));
  // teeth 0.9, 1.9, 2.9, 3.9
  EXPECT_EQ(systematicOffspring(arrayOf({0.1, 0.4, 0.4, 0.1}), 0.9), (Counts{0, 2, 1, 1}));
}

TEST(SystematicOffspring, GivesEachParticleTheFloorOrTheCeilingOfItsShare) {
  RandomStream stream(1);
  for (int trial = 0; trial < 5000; ++trial) {
    const auto J = static_cast<Eigen::Index>(1 + stream.below(60));
    const Eigen::ArrayXd weights = randomWeights(J, stream);
    const Counts offspring = systematicOffspring(weights, stream.uniform());
    ASSERT_EQ(offspring.size(), static_cast<std::size_t>(J));
    ASSERT_EQ(sum(offspring), static_cast<std::size_t>(J));
    for (Eigen::Index j = 0; j < J; ++j) {
      const double share = static_cast<double>(J) * weights(j);
      // 1e-12: J w_j is a difference of rounded sums
      ASSERT_GE(offspring[static_cast<std::size_t>(j)], std::floor(share - 1e-12));
      ASSERT_LE(offspring[static_cast<std::size_t>(j)], std::ceil(share + 1e-12));
    }
  }
}

TEST(SystematicOffspring, SumsToJWhenUIsAlmostOne) {
  RandomStream stream(2);
  for (int trial = 0; trial < 5000; ++trial) {
    const auto J = static_cast<Eigen::Index>(1 + stream.below(300));
    Eigen::ArrayXd weights = randomWeights(J, stream);
    const auto zeros = static_cast<Eigen::Index>(stream.below(static_cast<std::uint64_t>(J)));
    weights.tail(zeros).setZero();  // no point must fall on these, nor past them
    weights /= weights.sum();
    const Counts offspring = systematicOffspring(weights, kAlmostOne);
    ASSERT_EQ(sum(offspring), static_cast<std::size_t>(J));
    for (Eigen::Index j = J - zeros; j < J; ++j) {
      ASSERT_EQ(offspring[static_cast<std::size_t>(j)], 0U);
    }
  }
}

TEST(SystematicOffspring, SumsToJWhenTheWeightsSumToLessOrMoreThanOne) {
  for (const double scale : {1.0 - 1e-9, 1.0 + 1e-9, 0.25, 40.0}) {
    for (const double u : {0.0, 0.5, kAlmostOne}) {
      const Eigen::ArrayXd weights = scale * Eigen::ArrayXd::Constant(30, 1.0 / 30.0);
      EXPECT_EQ(sum(systematicOffspring(weights, u)), 30U) << scale << " " << u;
    }
  }
}

TEST(SystematicOffspring, GivesEverythingToTheOnlyParticleWithAWeight) {
  for (const Eigen::Index heir : {0, 3, 6}) {
    Eigen::ArrayXd weights = Eigen::ArrayXd::Zero(7);
    weights(heir) = 1.0;
    for (const double u : {0.0, 0.3, kAlmostOne}) {
      Counts expected(7, 0);
      expected[static_cast<std::size_t>(heir)] = 7;
      EXPECT_EQ(systematicOffspring(weights, u), expected);
    }
  }
}

TEST(SystematicOffspring, KeepsEveryoneWhenWeightsAreEqual) {
  for (const Eigen::Index J : {1, 3, 10, 49, 1000}) {
    // away from the ends of [0, 1), where the rounding of 1/J may decide
    for (const double u : {0.01, 0.5, 0.99}) {
      const Eigen::ArrayXd weights = Eigen::ArrayXd::Constant(J, 1.0 / static_cast<double>(J));
      EXPECT_EQ(systematicOffspring(weights, u), Counts(static_cast<std::size_t>(J), 1));
    }
  }
}

TEST(SystematicOffspring, AveragesToTheSharesOverItsDraw) {
  RandomStream stream(3);
  constexpr int kDraws = 2000;
  for (int trial = 0; trial < 10; ++trial) {
    const Eigen::ArrayXd weights = randomWeights(25, stream);
    Eigen::ArrayXd mean = Eigen::ArrayXd::Zero(25);
    for (int k = 0; k < kDraws; ++k) {
      const Counts offspring = systematicOffspring(weights, (k + 0.5) / kDraws);
      for (Eigen::Index j = 0; j < 25; ++j) mean(j) += offspring[static_cast<std::size_t>(j)];
    }
    mean /= kDraws;
    // a count jumps at two places in u, each met to one grid step
    EXPECT_LT((mean - 25.0 * weights).abs().maxCoeff(), 2.0 / kDraws);
  }
}

// ---- numbering of the offspring ----------------------------------------------------------------

std::size_t mapsThatChangeNode(const Counts& ancestors, const Counts& node_of) {
  std::size_t moves = 0;
  for (std::size_t slot = 0; slot < ancestors.size(); ++slot) {
    moves += node_of[slot] != node_of[ancestors[slot]] ? 1U : 0U;
  }
  return moves;
}

// Every multiset of offspring of J particles, one after the other.
void forEachOffspring(std::uint32_t particles, const std::function<void(const Counts&)>& visit) {
  Counts offspring;
  std::function<void(std::uint32_t)> extend = [&](std::uint32_t left) {
    if (offspring.size() + 1 == particles) {
      offspring.push_back(left);
      visit(offspring);
      offspring.pop_back();
      return;
    }
    for (std::uint32_t count = 0; count <= left; ++count) {
      offspring.push_back(count);
      extend(left - count);
      offspring.pop_back();
    }
  };
  extend(particles);
}

Counts sortedAncestors(const Counts& offspring) {
  Counts ancestors;
  for (std::uint32_t j = 0; j < offspring.size(); ++j) {
    ancestors.insert(ancestors.end(), offspring[j], j);
  }
  return ancestors;
}

TEST(NumberOffspring, IsAnAssignmentThatLetsSurvivorsStay) {
  RandomStream stream(4);
  for (int trial = 0; trial < 2000; ++trial) {
    const std::size_t J = 1 + stream.below(50);
    const Counts offspring =
        systematicOffspring(randomWeights(static_cast<Eigen::Index>(J), stream), stream.uniform());
    const Counts ancestors = numberOffspring(offspring, shareParticles(J, 1 + stream.below(J)));
    ASSERT_EQ(ancestors.size(), J);
    Counts seen(J, 0);
    for (const std::uint32_t ancestor : ancestors) {
      ASSERT_LT(ancestor, J);
      ++seen[ancestor];
    }
    ASSERT_EQ(seen, offspring);
    for (std::uint32_t j = 0; j < J; ++j) {
      ASSERT_TRUE(offspring[j] == 0 || ancestors[j] == j);
    }
  }
}

TEST(NumberOffspring, MovesAsFewMapsAsAnyNumbering) {
  for (std::uint32_t particles = 1; particles <= 6; ++particles) {
    for (std::size_t nodes = 1; nodes <= std::min<std::size_t>(3, particles); ++nodes) {
      const Counts node_of = shareParticles(particles, nodes);
      forEachOffspring(particles, [&](const Counts& offspring) {
        Counts numbering = sortedAncestors(offspring);
        std::size_t fewest = particles;
        do {
          fewest = std::min(fewest, mapsThatChangeNode(numbering, node_of));
        } while (std::next_permutation(numbering.begin(), numbering.end()));
        ASSERT_EQ(mapsThatChangeNode(numberOffspring(offspring, node_of), node_of), fewest);
      });
    }
  }
}

TEST(NumberOffspring, MovesNothingWhenEverybodySurvives) {
  EXPECT_EQ(numberOffspring({1, 1, 1, 1}, {0, 0, 1, 1}), (Counts{0, 1, 2, 3}));
}

// ---- shares ------------------------------------------------------------------------------------

TEST(ShareParticles, AreContiguousAndDifferByAtMostOneForAnyJAndB) {
  for (std::size_t particles = 1; particles <= 60; ++particles) {
    for (std::size_t nodes = 1; nodes <= particles; ++nodes) {
      const Counts node_of = shareParticles(particles, nodes);
      ASSERT_EQ(node_of.size(), particles);
      ASSERT_TRUE(std::is_sorted(node_of.begin(), node_of.end()));
      for (std::uint32_t node = 0; node < nodes; ++node) {
        const auto share =
            static_cast<std::size_t>(std::count(node_of.begin(), node_of.end(), node));
        ASSERT_GE(share, particles / nodes);
        ASSERT_LE(share, (particles + nodes - 1) / nodes);
      }
    }
  }
}

// The map nodes compute their shares by themselves: test/python compares with the same file.
TEST(ShareParticles, AreThoseOfTheSharedTable) {
  std::ifstream table(RBPF_TEST_DATA "/particle_shares.txt");
  ASSERT_TRUE(table) << "no " RBPF_TEST_DATA "/particle_shares.txt";
  int cases = 0;
  for (std::string line; std::getline(table, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream words(line);
    std::size_t particles = 0;
    std::size_t nodes = 0;
    std::string colon;
    words >> particles >> nodes >> colon;
    Counts expected;
    for (std::uint32_t node = 0; words >> node;) expected.push_back(node);
    ASSERT_EQ(expected.size(), particles) << line;
    EXPECT_EQ(shareParticles(particles, nodes), expected) << line;
    ++cases;
  }
  EXPECT_EQ(cases, 10);
}

}  // namespace
}  // namespace rbpf_core
