#include "rbpf_node/services.hpp"

#include "rbpf_node/conversions.hpp"

namespace rbpf_node {

namespace {

constexpr std::uint32_t kLargestMinibatch = 1000000;

void appendPose(const rbpf_core::Pose2& pose, const rbpf_core::Attitude& attitude,
                std::vector<std::uint8_t>* bytes) {
  const double values[6] = {pose.x_m,          pose.y_m,           attitude.z_m,
                            attitude.roll_rad, attitude.pitch_rad, pose.yaw_rad};
  appendBytes(values, 6, bytes);
}

}  // namespace

Services::Services(ros::NodeHandle private_node, const rbpf_core::ParticleFilter& filter,
                   const LoopClosureLoop& loop)
    : filter_(filter), loop_(loop) {
  minibatch_server_ =
      private_node.advertiseService("get_minibatches", &Services::getMinibatches, this);
  ping_server_ = private_node.advertiseService("get_pings", &Services::getPings, this);
}

bool Services::getMinibatches(rbpf_svgp_slam::GetMinibatches::Request& request,
                              rbpf_svgp_slam::GetMinibatches::Response& response) {
  // The epoch is read before any beam is placed: a batch that a resampling overtakes carries the
  // epoch before it, and the map nodes drop it. `resampling` is read before the epoch: "not
  // resampling" with the old epoch must mean that it was rolled back, never that it just ended
  // well.
  response.resampling = loop_.resampling();
  response.epoch = loop_.epoch();
  if (request.size == 0 || request.size > kLargestMinibatch) {
    response.message = "minibatch of " + std::to_string(request.size) + " beams, expected 1 to " +
                       std::to_string(kLargestMinibatch);
    return true;
  }
  const std::size_t particles = filter_.particleCount();
  for (const std::uint32_t particle : request.particles) {
    if (particle < particles) continue;
    response.message =
        "particle " + std::to_string(particle) + ", expected below " + std::to_string(particles);
    return true;
  }
  std::vector<rbpf_core::PlacedBeam> beams(request.particles.size() * request.size);
  for (std::size_t p = 0; p < request.particles.size(); ++p) {
    response.beams_in_log =
        filter_.drawMinibatch(request.particles[p], request.size, beams.data() + p * request.size);
    if (response.beams_in_log == 0) {
      response.message = "no beams in the log yet";
      return true;
    }
  }
  response.beams.reserve(beams.size() * sizeof(rbpf_core::PlacedBeam));
  appendBytes(beams.data(), beams.size(), &response.beams);
  minibatches_served_ += request.particles.size();
  response.success = true;
  return true;
}

bool Services::getPings(rbpf_svgp_slam::GetPings::Request& request,
                        rbpf_svgp_slam::GetPings::Response& response) {
  response.pings_total = filter_.pings();
  for (const rbpf_core::SurveyPing& ping : filter_.survey(request.first, request.count)) {
    const rbpf_core::PingRecord& record = ping.record;
    appendBytes(&record.stamp_s, 1, &response.stamps);
    appendPose(ping.estimate, record.attitude, &response.estimate);
    appendBytes(ping.std_m.data(), 2, &response.estimate_std);
    appendPose(record.dead_reckoning, record.attitude, &response.dead_reckoning);
    response.held_out.push_back(record.held_out);
    response.beams_per_ping.push_back(record.beams);
    appendBytes(ping.levelled_m.data(), static_cast<std::size_t>(ping.levelled_m.size()),
                &response.beams);
  }
  response.success = true;
  return true;
}

}  // namespace rbpf_node
