// The map nodes' requests for beams, answered by a filter of a short survey.
#include <gtest/gtest.h>

#include <cstdint>
#include <cstring>
#include <map>
#include <string>
#include <vector>

#include "../core/survey.hpp"
#include "rbpf_node/beam_requests.hpp"

namespace rbpf_node {
namespace {

using rbpf_core::ParticleFilter;
using rbpf_core::PlacedBeam;
using rbpf_svgp_slam::GetBeams;
using rbpf_svgp_slam::GetMinibatches;
using Beams = std::vector<PlacedBeam>;

constexpr std::size_t kParticles = 4;

GetBeams::Response beamsOf(const ParticleFilter& filter,
                           const std::vector<std::uint32_t>& particles, std::uint64_t first,
                           std::uint32_t size) {
  GetBeams::Request request;
  request.particles = particles;
  request.first = first;
  request.size = size;
  GetBeams::Response response;
  answer(filter, request, &response);
  return response;
}

GetMinibatches::Response minibatchesOf(const ParticleFilter& filter,
                                       const std::vector<std::uint32_t>& particles,
                                       std::uint32_t size) {
  GetMinibatches::Request request;
  request.particles = particles;
  request.size = size;
  GetMinibatches::Response response;
  answer(filter, request, &response);
  return response;
}

// 30 s, each particle on a track of its own.
class BeamRequests : public testing::Test {
 protected:
  BeamRequests() { rbpf_core::sail(filter_, rbpf_core::turning, 0, 30); }

  GetBeams::Response beams(const std::vector<std::uint32_t>& particles, std::uint64_t first,
                           std::uint32_t size) const {
    return beamsOf(filter_, particles, first, size);
  }

  Beams logOf(std::size_t particle) const {
    return rbpf_core::blockFrom(filter_, particle, 0, filter_.snapshot().beamsReleased());
  }

  ParticleFilter filter_{rbpf_core::noisyParams(kParticles)};
};

template <typename Value>
std::vector<Value> decoded(const std::vector<std::uint8_t>& bytes) {
  std::vector<Value> values(bytes.size() / sizeof(Value));
  EXPECT_EQ(bytes.size(), values.size() * sizeof(Value));
  std::memcpy(values.data(), bytes.data(), bytes.size());
  return values;
}

// What the particle in that row of the request makes of the response.
Beams placed(const GetBeams::Response& response, std::size_t row) {
  return rbpf_core::placed(
      {decoded<rbpf_core::LevelledBeam>(response.beams), response.beams_of_ping,
       decoded<rbpf_core::HistoryPose>(response.poses)},
      row);
}

Beams slice(const Beams& beams, std::size_t first, std::size_t size) {
  const auto begin = beams.begin() + static_cast<std::ptrdiff_t>(first);
  return {begin, begin + static_cast<std::ptrdiff_t>(size)};
}

// ---- get_beams ---------------------------------------------------------------------------------

TEST_F(BeamRequests, BeamsAreSentOnceAndPosesInTheOrderOfTheParticles) {
  const std::size_t n = filter_.snapshot().beamsReleased();
  const auto response = beams({2, 0}, 5, 10);
  EXPECT_EQ(response.message, "");
  EXPECT_EQ(response.beams_in_log, n);
  EXPECT_EQ(response.beams.size(), 10 * sizeof(rbpf_core::LevelledBeam));
  EXPECT_EQ(response.poses.size(), 2 * 24 * response.beams_of_ping.size());
  EXPECT_TRUE(placed(response, 0) == slice(logOf(2), 5, 10));
  EXPECT_TRUE(placed(response, 1) == slice(logOf(0), 5, 10));
  EXPECT_TRUE(placed(beams({3}, n - 4, 10), 0) == slice(logOf(3), n - 4, 4));
}

TEST_F(BeamRequests, AMapThatGoesOnWhereItStoppedTakesEveryBeamInOnceWhileTheLogGrows) {
  Beams taken;
  for (int t = 30; t < 45; ++t) {
    rbpf_core::sail(filter_, rbpf_core::turning, t, t + 1);
    const Beams sent = placed(beams({1}, taken.size(), 37), 0);
    taken.insert(taken.end(), sent.begin(), sent.end());
  }
  while (taken.size() < filter_.snapshot().beamsReleased()) {
    const Beams sent = placed(beams({1}, taken.size(), 37), 0);
    ASSERT_FALSE(sent.empty());
    taken.insert(taken.end(), sent.begin(), sent.end());
  }
  EXPECT_TRUE(taken == logOf(1));
}

TEST_F(BeamRequests, MapsThatHaveTakenInEverythingAreSentNothing) {
  const auto response = beams({0, 1}, filter_.snapshot().beamsReleased(), 100);
  EXPECT_EQ(response.message, "");
  EXPECT_TRUE(response.beams.empty());
  EXPECT_TRUE(response.beams_of_ping.empty());
  EXPECT_TRUE(response.poses.empty());
}

TEST_F(BeamRequests, TheWholeLogMayBeAskedForAtOnce) {
  const auto response = beams({0, 1, 2, 3}, 0, 2500000);
  EXPECT_EQ(response.message, "");
  EXPECT_TRUE(placed(response, 3) == logOf(3));
}

TEST_F(BeamRequests, TellThePastThatTheBeamsArePlacedBy) {
  const Beams before = logOf(1);
  const auto first = beams({1}, 0, 10);
  EXPECT_EQ(first.past, 0U);
  EXPECT_EQ(minibatchesOf(filter_, {1}, 10).past, 0U);
  filter_.correctPast({{}, {10.0, 0.0, 0.0}, {}});
  const auto second = beams({1}, 0, 10);
  EXPECT_EQ(second.past, 1U);
  EXPECT_EQ(minibatchesOf(filter_, {}, 1).past, 1U);  // also where no beams are wanted
  EXPECT_NEAR(placed(second, 0)[3].x_m, placed(first, 0)[3].x_m + 10.0F, 1e-5F);  // float32
}

TEST_F(BeamRequests, AreRefusedWithTheNameTheValueAndWhatWasExpected) {
  const std::size_t n = filter_.snapshot().beamsReleased();
  const std::string log = std::to_string(n);
  const std::string beyond = std::to_string(n + 1);
  const std::map<std::string, GetBeams::Response> refused = {
      {"size is 0, expected at least 1 beam", beams({0}, 0, 0)},
      {"size is 5000001 for each of 2 particles, expected at most 10000000 beams in all",
       beams({0, 1}, 0, 5000001)},
      {"size is 4294967295 for each of 1 particles, expected at most 10000000 beams in all",
       beams({0}, 0, 4294967295)},
      {"first is " + beyond + ", expected at most " + log + ", the beams in the log",
       beams({0, 3}, n + 1, 10)},
      {"first is 18446744073709551615, expected at most " + log + ", the beams in the log",
       beams({0}, 18446744073709551615U, 10)},
      {"particle 4, expected below 4", beams({0, 4}, 0, 10)},
  };
  for (const auto& [message, response] : refused) {
    EXPECT_EQ(response.message, message);
    EXPECT_TRUE(response.beams.empty());
    EXPECT_TRUE(response.poses.empty());
  }
}

TEST(BeamRequestsOfAnEmptyLog, AreRefusedAlike) {
  const ParticleFilter filter(rbpf_core::noisyParams(kParticles));
  EXPECT_EQ(beamsOf(filter, {0}, 0, 10).message, "no beams in the log yet");
  EXPECT_EQ(minibatchesOf(filter, {0}, 10).message, "no beams in the log yet");
}

// ---- get_minibatches ---------------------------------------------------------------------------

TEST_F(BeamRequests, MinibatchesFollowOneAnotherInTheOrderOfTheParticles) {
  const auto response = minibatchesOf(filter_, {3, 1}, 50);
  EXPECT_EQ(response.message, "");
  EXPECT_EQ(response.beams_in_log, filter_.snapshot().beamsReleased());
  ParticleFilter same(rbpf_core::noisyParams(kParticles));
  rbpf_core::sail(same, rbpf_core::turning, 0, 30);
  const Beams sent = decoded<PlacedBeam>(response.beams);
  ASSERT_EQ(sent.size(), 100U);
  EXPECT_TRUE(slice(sent, 0, 50) == rbpf_core::drawFrom(same, 3, 50));
  EXPECT_TRUE(slice(sent, 50, 50) == rbpf_core::drawFrom(same, 1, 50));
}

TEST_F(BeamRequests, MinibatchesAreRefusedWithTheValueAndWhatWasExpected) {
  EXPECT_EQ(minibatchesOf(filter_, {0}, 0).message, "minibatch of 0 beams, expected 1 to 1000000");
  EXPECT_EQ(minibatchesOf(filter_, {0}, 1000001).message,
            "minibatch of 1000001 beams, expected 1 to 1000000");
  EXPECT_EQ(minibatchesOf(filter_, {0, 4}, 10).message, "particle 4, expected below 4");
  // one particle again and again: 120 GB
  EXPECT_EQ(minibatchesOf(filter_, std::vector<std::uint32_t>(10000, 0), 1000000).message,
            "minibatches of 1000000 beams for 10000 particles, expected at most 10000000 beams in "
            "all");
}

}  // namespace
}  // namespace rbpf_node
