#include "rbpf_node/beam_requests.hpp"

#include <algorithm>
#include <string>
#include <vector>

#include "rbpf_node/conversions.hpp"

namespace rbpf_node {

namespace {

using rbpf_svgp_slam::GetBeams;
using rbpf_svgp_slam::GetMinibatches;

constexpr std::uint32_t kLargestMinibatch = 1000000;
constexpr std::uint64_t kLargestReply = 10000000;  // beams or poses at most: 240 MB
constexpr const char* kNoBeams = "no beams in the log yet";

// Each of these returns what is wrong; an empty string if nothing is.

std::string problemWithParticles(const std::vector<std::uint32_t>& requested,
                                 std::size_t particles) {
  for (const std::uint32_t particle : requested) {
    if (particle < particles) continue;
    return "particle " + std::to_string(particle) + ", expected below " + std::to_string(particles);
  }
  return "";
}

std::string problemWith(const GetMinibatches::Request& request, std::size_t particles) {
  if (request.size == 0 || request.size > kLargestMinibatch) {
    return "minibatch of " + std::to_string(request.size) + " beams, expected 1 to " +
           std::to_string(kLargestMinibatch);
  }
  if (request.size * request.particles.size() > kLargestReply) {
    return "minibatches of " + std::to_string(request.size) + " beams for " +
           std::to_string(request.particles.size()) + " particles, expected at most " +
           std::to_string(kLargestReply) + " beams in all";
  }
  return problemWithParticles(request.particles, particles);
}

std::string problemWith(const GetBeams::Request& request, std::size_t particles,
                        std::size_t beams_in_log) {
  if (request.size == 0) return "size is 0, expected at least 1 beam";
  // A beam may be all that there is of its ping: then there are as many poses.
  const std::uint64_t particles_asked = std::max<std::size_t>(request.particles.size(), 1);
  if (request.size * particles_asked > kLargestReply) {
    return "size is " + std::to_string(request.size) + " for each of " +
           std::to_string(request.particles.size()) + " particles, expected at most " +
           std::to_string(kLargestReply) + " beams in all";
  }
  if (request.first > beams_in_log) {
    return "first is " + std::to_string(request.first) + ", expected at most " +
           std::to_string(beams_in_log) + ", the beams in the log";
  }
  return problemWithParticles(request.particles, particles);
}

}  // namespace

void answer(const rbpf_core::ParticleFilter& filter, const GetMinibatches::Request& request,
            GetMinibatches::Response* response) {
  response->message = problemWith(request, filter.params().particles);
  if (!response->message.empty()) return;
  const rbpf_core::FilterSnapshot snapshot = filter.snapshot();
  response->past = snapshot.past();
  response->beams_in_log = snapshot.beamsReleased();
  if (response->beams_in_log == 0) {
    response->message = kNoBeams;
    return;
  }
  std::vector<rbpf_core::PlacedBeam> beams(request.particles.size() * request.size);
  for (std::size_t p = 0; p < request.particles.size(); ++p) {
    snapshot.drawMinibatch(request.particles[p], request.size, beams.data() + p * request.size);
  }
  appendBytes(beams.data(), beams.size(), &response->beams);
}

void answer(const rbpf_core::ParticleFilter& filter, const GetBeams::Request& request,
            GetBeams::Response* response) {
  const rbpf_core::FilterSnapshot snapshot = filter.snapshot();
  const std::size_t beams_in_log = snapshot.beamsReleased();
  response->past = snapshot.past();
  response->beams_in_log = beams_in_log;
  response->message = problemWith(request, filter.params().particles, beams_in_log);
  if (response->message.empty() && beams_in_log == 0) response->message = kNoBeams;
  if (!response->message.empty()) return;
  const std::size_t size = std::min<std::size_t>(request.size, beams_in_log - request.first);
  const rbpf_core::LogBlock block = snapshot.logBlock(request.particles, request.first, size);
  appendBytes(block.beams.data(), block.beams.size(), &response->beams);
  response->beams_of_ping = block.beams_of_ping;
  appendBytes(block.poses.data(), block.poses.size(), &response->poses);
}

}  // namespace rbpf_node
