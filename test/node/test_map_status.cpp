// What a map node says of itself is looked at before it is believed.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "rbpf_node/map_nodes.hpp"

namespace rbpf_node {
namespace {

using rbpf_svgp_slam::MapStatus;

const std::vector<std::uint32_t> kOwn = {3, 4};

// Of node 1, which owns particles 3 and 4.
MapStatus goodStatus() {
  MapStatus status;
  status.node = 1;
  status.particles = kOwn;
  status.iterations = {10, 12};
  status.ready = {true, false};
  status.objective = {-1.0, -2.0};
  return status;
}

TEST(MapStatus, IsBelievedIfItIsTheNodesOwn) { EXPECT_EQ(problemWith(goodStatus(), 1, kOwn), ""); }

TEST(MapStatus, OfAnotherNodeIsRefused) {
  MapStatus status = goodStatus();
  status.node = 4000000000;
  EXPECT_EQ(problemWith(status, 1, kOwn), "node is 4000000000, expected 1");
}

TEST(MapStatus, OfOtherParticlesIsRefused) {
  MapStatus status = goodStatus();
  status.particles = {3, 5};
  EXPECT_EQ(problemWith(status, 1, kOwn),
            "it has maps of 2 particles, expected those of its own 2");
}

TEST(MapStatus, OfWrongSizesIsRefused) {
  for (auto shorten :
       {+[](MapStatus* s) { s->iterations.pop_back(); }, +[](MapStatus* s) { s->ready.pop_back(); },
        +[](MapStatus* s) { s->objective.pop_back(); }}) {
    MapStatus status = goodStatus();
    shorten(&status);
    EXPECT_EQ(problemWith(status, 1, kOwn),
              "it has an array of 1, expected one value for each of its 2 particles");
  }
  MapStatus status = goodStatus();
  status.ready.resize(1000000, true);
  EXPECT_NE(problemWith(status, 1, kOwn), "");
}

}  // namespace
}  // namespace rbpf_node
