#include "rbpf_node/services.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <string>

#include "rbpf_node/beam_requests.hpp"
#include "rbpf_node/conversions.hpp"

namespace rbpf_node {

namespace {

// At once: some 150 MB with a thousand beams each.
constexpr std::uint64_t kMostPings = 10000;

void appendPose(const rbpf_core::Pose2& pose, const rbpf_core::Attitude& attitude,
                std::vector<std::uint8_t>* bytes) {
  const double values[6] = {pose.x_m,          pose.y_m,           attitude.z_m,
                            attitude.roll_rad, attitude.pitch_rad, pose.yaw_rad};
  appendBytes(values, 6, bytes);
}

// Row by row.
std::array<double, 6> upperTriangle(const Eigen::Matrix3d& covariance) {
  return {covariance(0, 0), covariance(0, 1), covariance(0, 2),
          covariance(1, 1), covariance(1, 2), covariance(2, 2)};
}

void appendCovariance(const Eigen::Matrix3d& covariance, std::vector<std::uint8_t>* bytes) {
  appendBytes(upperTriangle(covariance).data(), 6, bytes);
}

rbpf_svgp_slam::Closure toMessage(const rbpf_core::smoothing::Closure& closure) {
  const rbpf_core::smoothing::Registration& registration = closure.registration;
  const rbpf_core::Pose2& found = registration.found.pose;
  rbpf_svgp_slam::Closure message;
  message.stamp = closure.stamp_s;
  message.stamp_older = closure.stamp_older_s;
  message.relative = {found.x_m, found.y_m, found.yaw_rad};
  const auto covariance = upperTriangle(registration.found.covariance);
  std::copy(covariance.begin(), covariance.end(), message.covariance.begin());
  message.shift = {closure.shift.x(), closure.shift.y(), closure.shift.z()};
  message.rms_m = registration.rms_m;
  message.beams = registration.beams;
  message.weight = closure.weight;
  message.verdict = nameOf(registration.verdict);
  return message;
}

rbpf_svgp_slam::Fix toMessage(const rbpf_core::FixRecord& record) {
  const rbpf_core::Fix& fix = record.fix;
  const rbpf_core::Pose2& reckoned = record.dead_reckoning;
  const double unknown = std::numeric_limits<double>::quiet_NaN();
  rbpf_svgp_slam::Fix message;
  message.stamp = fix.stamp_s;
  message.position = {fix.position_m.x(), fix.position_m.y()};
  message.covariance = {fix.covariance_m2(0, 0), fix.covariance_m2(0, 1), fix.covariance_m2(1, 1)};
  message.yaw = fix.heading ? fix.heading->yaw_rad : unknown;
  message.yaw_variance = fix.heading ? fix.heading->variance_rad2 : unknown;
  message.dead_reckoning = {reckoned.x_m, reckoned.y_m, reckoned.yaw_rad};
  return message;
}

}  // namespace

Services::Services(ros::NodeHandle private_node, std::uint64_t survey,
                   const rbpf_core::ParticleFilter& filter,
                   const rbpf_core::LoopClosing& loop_closing, const SmoothingWorker& smoothing)
    : survey_(survey), filter_(filter), loop_closing_(loop_closing), smoothing_(smoothing) {
  using rbpf_svgp_slam::GetBeams;
  using rbpf_svgp_slam::GetMinibatches;
  minibatch_server_ = private_node.advertiseService(
      "get_minibatches", &Services::serveBeams<GetMinibatches::Request, GetMinibatches::Response>,
      this);
  beam_server_ = private_node.advertiseService(
      "get_beams", &Services::serveBeams<GetBeams::Request, GetBeams::Response>, this);
  ping_server_ = private_node.advertiseService("get_pings", &Services::getPings, this);
  closure_server_ = private_node.advertiseService("get_closures", &Services::getClosures, this);
  fix_server_ = private_node.advertiseService("get_fixes", &Services::getFixes, this);
}

template <typename Request, typename Response>
bool Services::serveBeams(Request& request, Response& response) {
  // Before any beam is placed: beams that a resampling overtakes carry the epoch before it, and the
  // map nodes drop them.
  const rbpf_core::LoopClosing::Progress progress = loop_closing_.progress();
  response.survey = survey_;
  response.epoch = progress.epoch;
  response.resampling = progress.resampling;
  answer(filter_, request, &response);
  response.success = response.message.empty();
  return true;
}

bool Services::getPings(rbpf_svgp_slam::GetPings::Request& request,
                        rbpf_svgp_slam::GetPings::Response& response) {
  if (request.count > kMostPings) {
    response.message = "count is " + std::to_string(request.count) + ", expected at most " +
                       std::to_string(kMostPings) + " pings";
    return true;
  }
  const rbpf_core::FilterSnapshot snapshot = filter_.snapshot();
  response.pings_total = snapshot.pings();
  const auto smoothed = smoothing_.result();
  std::size_t number = request.first;
  for (const rbpf_core::SurveyPing& ping : snapshot.survey(request.first, request.count)) {
    const rbpf_core::PingRecord& record = ping.record;
    appendBytes(&record.stamp_s, 1, &response.stamps);
    appendPose(ping.estimate, record.attitude, &response.estimate);
    const bool is_smoothed = number < smoothed->covariances.size();
    // What particles still differ in is no more than the graph knows of.
    appendCovariance(is_smoothed ? smoothed->covariances[number] : ping.covariance,
                     &response.estimate_covariance);
    ++number;
    appendPose(record.online, record.attitude, &response.online);
    appendCovariance(record.online_covariance, &response.online_covariance);
    appendPose(record.dead_reckoning, record.attitude, &response.dead_reckoning);
    response.held_out.push_back(record.held_out);
    response.beams_per_ping.push_back(record.beams);
    appendBytes(ping.levelled_m.data(), static_cast<std::size_t>(ping.levelled_m.size()),
                &response.beams);
  }
  response.success = true;
  return true;
}

bool Services::getClosures(rbpf_svgp_slam::GetClosures::Request&,
                           rbpf_svgp_slam::GetClosures::Response& response) {
  for (const auto& closure : smoothing_.result()->closures) {
    response.closures.push_back(toMessage(closure));
  }
  response.success = true;
  return true;
}

bool Services::getFixes(rbpf_svgp_slam::GetFixes::Request&,
                        rbpf_svgp_slam::GetFixes::Response& response) {
  const rbpf_core::FilterSnapshot snapshot = filter_.snapshot();
  for (std::size_t i = 0; i < snapshot.fixes(); ++i) {
    response.fixes.push_back(toMessage(snapshot.fix(i)));
  }
  response.success = true;
  return true;
}

}  // namespace rbpf_node
