#include "rbpf_core/log_block.hpp"

namespace rbpf_core {

LogBlock logBlock(const MbesLog& log, std::size_t first, std::size_t size,
                  const Trajectories& trajectories, const std::vector<std::uint32_t>& particles,
                  const Origin& origin) {
  LogBlock block;
  block.beams.reserve(size);
  std::vector<PoseSlot> slots;
  for (std::size_t i = first; i < first + size; ++i) {
    const LoggedBeam& beam = log[i];
    if (slots.empty() || slots.back() != beam.slot) {
      slots.push_back(beam.slot);
      block.beams_of_ping.push_back(0);
    }
    ++block.beams_of_ping.back();
    block.beams.push_back({beam.x_m, beam.y_m, beam.z_m});
  }
  block.poses.reserve(particles.size() * slots.size());
  for (const std::uint32_t particle : particles) {
    for (const PoseSlot slot : slots) {
      HistoryPose pose = trajectories.at(particle, slot);
      pose.x_m -= origin.x_m;
      pose.y_m -= origin.y_m;
      block.poses.push_back(pose);
    }
  }
  return block;
}

}  // namespace rbpf_core
