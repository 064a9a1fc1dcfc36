#include "rbpf_core/minibatch.hpp"

namespace rbpf_core {

PlacedBeam place(const LoggedBeam& beam, const HistoryPose& pose, const Origin& origin) {
  const float east_m = pose.cos_yaw * beam.x_m - pose.sin_yaw * beam.y_m;
  const float north_m = pose.sin_yaw * beam.x_m + pose.cos_yaw * beam.y_m;
  return {static_cast<float>(pose.x_m - origin.x_m) + east_m,
          static_cast<float>(pose.y_m - origin.y_m) + north_m, beam.z_m};
}

void drawMinibatch(const MbesLog& log, std::size_t beams, const TrajectoryHistories& histories,
                   std::size_t particle, const Origin& origin, RandomStream stream,
                   std::size_t size, PlacedBeam* out) {
  for (std::size_t i = 0; i < size; ++i) {
    const LoggedBeam& beam = log[stream.below(beams)];
    out[i] = place(beam, histories.at(particle, beam.ping), origin);
  }
}

void placeBlock(const MbesLog& log, std::size_t first, std::size_t size,
                const TrajectoryHistories& histories, std::size_t particle, const Origin& origin,
                PlacedBeam* out) {
  const std::size_t end = first + size;
  for (std::size_t i = first; i < end;) {
    // a ping's beams follow one another: one look-up for all of them
    const std::uint32_t ping = log[i].ping;
    const HistoryPose& pose = histories.at(particle, ping);
    for (; i < end && log[i].ping == ping; ++i) *out++ = place(log[i], pose, origin);
  }
}

}  // namespace rbpf_core
