#include "gmrf/many_maps.hpp"

#include <algorithm>
#include <stdexcept>
#include <string>

namespace gmrf {

void LevelledBlock::check() const {
  if (ping.size() != static_cast<std::size_t>(beams_m.cols())) {
    throw std::invalid_argument("pings are given for " + std::to_string(ping.size()) +
                                " beams; expected " + std::to_string(beams_m.cols()));
  }
  for (const std::uint32_t p : ping) {
    if (p < pings) continue;
    throw std::invalid_argument("a beam is of ping " + std::to_string(p) + "; expected below " +
                                std::to_string(pings));
  }
  if (!beams_m.allFinite()) {
    throw std::invalid_argument("a levelled beam is not finite; expected finite metres");
  }
}

Beams LevelledBlock::placed(const PlacingPose* poses) const {
  Beams beams(3, beams_m.cols());
  for (Eigen::Index i = 0; i < beams_m.cols(); ++i) {
    const PlacingPose& pose = poses[ping[static_cast<std::size_t>(i)]];
    const double x = beams_m(0, i);
    const double y = beams_m(1, i);
    beams(0, i) = pose.x_m + pose.cos_yaw * x - pose.sin_yaw * y;
    beams(1, i) = pose.y_m + pose.sin_yaw * x + pose.cos_yaw * y;
    beams(2, i) = beams_m(2, i);
  }
  return beams;
}

void foldIntoAll(const std::vector<Map*>& maps, const LevelledBlock& block,
                 const std::vector<PlacingPose>& poses, const Eigen::VectorXd& weights) {
  block.check();
  if (poses.size() != maps.size() * block.pings) {
    throw std::invalid_argument(std::to_string(poses.size()) + " poses; expected " +
                                std::to_string(maps.size() * block.pings));
  }
  for (std::size_t m = 0; m < maps.size(); ++m) {
    maps[m]->expectGood(block.placed(poses.data() + m * block.pings), weights);
  }
  for (std::size_t m = 0; m < maps.size(); ++m) {
    maps[m]->foldGood(block.placed(poses.data() + m * block.pings), weights);
  }
}

}  // namespace gmrf
