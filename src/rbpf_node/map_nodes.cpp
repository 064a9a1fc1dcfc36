#include "rbpf_node/map_nodes.hpp"

#include <algorithm>
#include <limits>
#include <stdexcept>

#include "rbpf_core/resampling.hpp"
#include "rbpf_node/conversions.hpp"
#include "rbpf_node/parallel_calls.hpp"
#include "rbpf_svgp_slam/CommitResampling.h"
#include "rbpf_svgp_slam/PredictBeams.h"
#include "rbpf_svgp_slam/PrepareResampling.h"

namespace rbpf_node {

using rbpf_svgp_slam::CommitResampling;
using rbpf_svgp_slam::MapStatus;
using rbpf_svgp_slam::PredictBeams;
using rbpf_svgp_slam::PrepareResampling;

namespace {

constexpr double kErrorPeriod_s = 10.0;

// x, y of a ping's beams as one particle sees them, relative to the survey origin, [n, 2].
std::vector<float> positionsOf(const rbpf_core::Beams& levelled_m, const rbpf_core::Pose2& pose,
                               const rbpf_core::Origin& origin) {
  const rbpf_core::Beams placed =
      placeBeams(levelled_m, {pose.x_m - origin.x_m, pose.y_m - origin.y_m, pose.yaw_rad});
  std::vector<float> positions;
  for (Eigen::Index i = 0; i < placed.cols(); ++i) {
    positions.insert(positions.end(), {placed(0, i), placed(1, i)});
  }
  return positions;
}

// The rows of one node's particles. Throws std::invalid_argument that names the part of the answer
// whose size is not what was asked for.
void takeIn(const std::string& name, const PredictBeams::Request& request,
            const PredictBeams::Response& response, rbpf_core::PingPrediction* prediction) {
  const auto& particles = request.particles;
  const std::size_t points = request.points;
  const auto mean = toFloats(response.mean, particles.size() * points, name + " mean");
  const auto variance = toFloats(response.variance, particles.size() * points, name + " variance");
  const auto prior = toFloats(response.prior_variance, particles.size(), name + " prior_variance");
  const auto n = static_cast<Eigen::Index>(points);
  for (std::size_t p = 0; p < particles.size(); ++p) {
    const Eigen::Index j = particles[p];
    prediction->mean_m.row(j) =
        Eigen::Map<const Eigen::RowVectorXf>(&mean[p * points], n).cast<double>();
    prediction->variance_m2.row(j) =
        Eigen::Map<const Eigen::RowVectorXf>(&variance[p * points], n).cast<double>();
    prediction->prior_variance_m2(j) = prior[p];
  }
}

// Throws if any call failed.
template <typename Service>
void expectSuccess(const std::vector<CallAnswer<Service>>& answers) {
  if (const std::string errors = errorsOf(answers); !errors.empty()) {
    throw std::runtime_error(errors);
  }
}

}  // namespace

std::string problemWith(const MapStatus& status, std::size_t node,
                        const std::vector<std::uint32_t>& particles) {
  if (status.node != node) {
    return "node is " + std::to_string(status.node) + ", expected " + std::to_string(node);
  }
  const std::size_t J = particles.size();
  if (status.particles != particles) {
    return "it has maps of " + std::to_string(status.particles.size()) +
           " particles, expected those of its own " + std::to_string(J);
  }
  for (const std::size_t size :
       {status.iterations.size(), status.ready.size(), status.objective.size()}) {
    if (size == J) continue;
    return "it has an array of " + std::to_string(size) + ", expected one value for each of its " +
           std::to_string(J) + " particles";
  }
  return "";
}

MapNodes::MapNodes(ros::NodeHandle node, const Parameters& params, std::uint64_t survey)
    : node_(std::move(node)),
      nodes_(params.nodes),
      survey_(survey),
      origin_(params.filter.origin),
      predict_timeout_s_(params.loop_closure_timeout_s),
      resampling_timeout_s_(params.resampling_timeout_s),
      node_of_(rbpf_core::shareParticles(params.filter.particles, params.nodes)),
      particles_of_(params.nodes) {
  for (std::uint32_t j = 0; j < node_of_.size(); ++j) particles_of_[node_of_[j]].push_back(j);
}

void MapNodes::listen() {
  for (std::size_t k = 0; k < nodes_; ++k) {
    subscribers_.push_back(node_.subscribe<MapStatus>(
        service(k, "status"), 10,
        [this, k](const MapStatus::ConstPtr& status) { hear(k, *status); }));
  }
}

void MapNodes::takeStates(const std::vector<MapStatus>& states) {
  for (const MapStatus& status : states) {
    hear(std::min<std::size_t>(status.node, nodes_ - 1), status);
  }
}

void MapNodes::hear(std::size_t node, const MapStatus& status) {
  if (const std::string problem = problemWith(status, node, particles_of_[node]);
      !problem.empty()) {
    ROS_ERROR_THROTTLE(kErrorPeriod_s, "Status of svgp_node_%zu refused: %s", node,
                       problem.c_str());
    return;
  }
  const std::lock_guard lock(mutex_);
  latest_[node] = {status, ros::WallTime::now()};
}

std::map<std::size_t, double> MapNodes::silence() const {
  const ros::WallTime now = ros::WallTime::now();
  const std::lock_guard lock(mutex_);
  std::map<std::size_t, double> silent_s;
  for (const auto& [node, heard] : latest_) silent_s[node] = (now - heard.at).toSec();
  return silent_s;
}

std::string MapNodes::service(std::size_t node, const std::string& name) const {
  return node_.resolveName("svgp_node_" + std::to_string(node) + "/" + name);
}

std::vector<std::string> MapNodes::services(const std::string& name) const {
  std::vector<std::string> names;
  for (std::size_t k = 0; k < nodes_; ++k) names.push_back(service(k, name));
  return names;
}

rbpf_core::MapsState MapNodes::state(std::uint32_t epoch) const {
  const std::lock_guard lock(mutex_);
  rbpf_core::MapsState state;
  state.nodes = nodes_;
  state.elbo.setConstant(static_cast<Eigen::Index>(node_of_.size()),
                         std::numeric_limits<double>::quiet_NaN());
  for (const auto& [node, heard] : latest_) {
    const MapStatus& status = heard.status;
    if (status.survey != survey_) continue;
    state.steps += status.steps;
    if (status.epoch != epoch) continue;
    ++state.nodes_heard;
    state.pasts.push_back(status.past);
    state.maps_ready += static_cast<std::size_t>(
        std::count_if(status.ready.begin(), status.ready.end(), [](auto r) { return r != 0; }));
    for (std::size_t k = 0; k < status.particles.size(); ++k) {
      state.elbo(status.particles[k]) = status.objective[k];
    }
  }
  return state;
}

rbpf_core::PingPrediction MapNodes::predict(std::uint32_t epoch,
                                            const rbpf_core::PlacedPing& ping) {
  const Eigen::Index n = ping.levelled_m.cols();
  std::vector<PredictBeams::Request> requests(nodes_);
  for (PredictBeams::Request& request : requests) {
    request.survey = survey_;
    request.epoch = epoch;
    request.points = static_cast<std::uint32_t>(n);
  }
  for (std::uint32_t j = 0; j < ping.poses.size(); ++j) {
    PredictBeams::Request& request = requests[node_of_[j]];
    const std::vector<float> positions = positionsOf(ping.levelled_m, ping.poses[j], origin_);
    request.particles.push_back(j);
    appendBytes(positions.data(), positions.size(), &request.positions);
  }
  const std::vector<std::string> names = services("predict");
  const auto answers = callAll<PredictBeams>(names, requests, predict_timeout_s_);
  expectSuccess(answers);
  const auto J = static_cast<Eigen::Index>(ping.poses.size());
  rbpf_core::PingPrediction prediction{Eigen::ArrayXXd(J, n), Eigen::ArrayXXd(J, n),
                                       Eigen::ArrayXd(J)};
  for (std::size_t k = 0; k < nodes_; ++k) {
    takeIn(names[k], requests[k], answers[k].response, &prediction);
  }
  return prediction;
}

rbpf_core::MovedMaps MapNodes::prepare(std::uint32_t epoch,
                                       const std::vector<std::uint32_t>& ancestors) {
  PrepareResampling::Request request;
  request.survey = survey_;
  request.epoch = epoch;
  request.ancestors = ancestors;
  const auto answers = callAll<PrepareResampling>(
      services("prepare_resampling"), std::vector<PrepareResampling::Request>(nodes_, request),
      resampling_timeout_s_);
  expectSuccess(answers);
  rbpf_core::MovedMaps moved;
  for (const auto& answer : answers) {
    moved.maps += answer.response.maps_fetched;
    moved.bytes += answer.response.bytes_fetched;
  }
  return moved;
}

void MapNodes::endResampling(std::uint32_t epoch, bool commit) const {
  CommitResampling::Request request;
  request.survey = survey_;
  request.epoch = epoch;
  request.commit = commit;
  expectSuccess(callAll<CommitResampling>(services("commit_resampling"),
                                          std::vector<CommitResampling::Request>(nodes_, request),
                                          resampling_timeout_s_));
}

}  // namespace rbpf_node
