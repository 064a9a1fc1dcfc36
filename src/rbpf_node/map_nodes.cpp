#include "rbpf_node/map_nodes.hpp"

#include <algorithm>
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

MapNodes::MapNodes(ros::NodeHandle node, const Parameters& params)
    : node_(std::move(node)),
      nodes_(params.nodes),
      predict_timeout_s_(params.loop_closure_timeout_s),
      resampling_timeout_s_(params.resampling_timeout_s),
      node_of_(rbpf_core::shareParticles(params.filter.particles, params.nodes)) {}

void MapNodes::listen() {
  for (std::size_t k = 0; k < nodes_; ++k) {
    subscribers_.push_back(node_.subscribe<MapStatus>(service(k, "status"), 10,
                                                      [this](const MapStatus::ConstPtr& status) {
                                                        const std::lock_guard lock(mutex_);
                                                        latest_[status->node] = *status;
                                                      }));
  }
}

void MapNodes::takeStates(const std::vector<MapStatus>& states) {
  const std::lock_guard lock(mutex_);
  for (const MapStatus& status : states) latest_[status.node] = status;
}

std::string MapNodes::service(std::size_t node, const std::string& name) const {
  return node_.resolveName("svgp_node_" + std::to_string(node) + "/" + name);
}

MapsState MapNodes::state(std::uint32_t epoch) const {
  const std::lock_guard lock(mutex_);
  MapsState state;
  for (const auto& [node, status] : latest_) {
    state.steps += status.steps;
    if (status.epoch != epoch) continue;
    ++state.nodes_heard;
    state.maps_ready += static_cast<std::size_t>(
        std::count_if(status.ready.begin(), status.ready.end(), [](auto r) { return r != 0; }));
  }
  return state;
}

rbpf_core::PingPrediction MapNodes::predict(
    std::uint32_t epoch, const std::vector<std::vector<float>>& positions) const {
  const std::size_t points = positions.front().size() / 2;
  std::vector<std::string> names;
  std::vector<PredictBeams::Request> requests(nodes_);
  for (std::size_t k = 0; k < nodes_; ++k) {
    names.push_back(service(k, "predict"));
    requests[k].epoch = epoch;
    requests[k].points = static_cast<std::uint32_t>(points);
  }
  for (std::uint32_t j = 0; j < positions.size(); ++j) {
    PredictBeams::Request& request = requests[node_of_[j]];
    request.particles.push_back(j);
    appendBytes(positions[j].data(), positions[j].size(), &request.positions);
  }
  const auto answers = callAll<PredictBeams>(names, requests, predict_timeout_s_);
  if (const std::string errors = errorsOf(answers); !errors.empty()) {
    throw std::runtime_error(errors);
  }
  const auto J = static_cast<Eigen::Index>(positions.size());
  const auto n = static_cast<Eigen::Index>(points);
  rbpf_core::PingPrediction prediction{Eigen::ArrayXXd(J, n), Eigen::ArrayXXd(J, n),
                                       Eigen::ArrayXd(J)};
  for (std::size_t k = 0; k < nodes_; ++k) {
    const auto& particles = requests[k].particles;
    const auto& response = answers[k].response;
    const auto mean = toFloats(response.mean, particles.size() * points, names[k] + " mean");
    const auto variance =
        toFloats(response.variance, particles.size() * points, names[k] + " variance");
    const auto prior =
        toFloats(response.prior_variance, particles.size(), names[k] + " prior_variance");
    for (std::size_t p = 0; p < particles.size(); ++p) {
      const Eigen::Index j = particles[p];
      prediction.mean_m.row(j) =
          Eigen::Map<const Eigen::RowVectorXf>(&mean[p * points], n).cast<double>();
      prediction.variance_m2.row(j) =
          Eigen::Map<const Eigen::RowVectorXf>(&variance[p * points], n).cast<double>();
      prediction.prior_variance_m2(j) = prior[p];
    }
  }
  return prediction;
}

MovedMaps MapNodes::prepare(std::uint32_t epoch,
                            const std::vector<std::uint32_t>& ancestors) const {
  std::vector<std::string> names;
  PrepareResampling::Request request;
  request.epoch = epoch;
  request.ancestors = ancestors;
  for (std::size_t k = 0; k < nodes_; ++k) names.push_back(service(k, "prepare_resampling"));
  const auto answers = callAll<PrepareResampling>(
      names, std::vector<PrepareResampling::Request>(nodes_, request), resampling_timeout_s_);
  if (const std::string errors = errorsOf(answers); !errors.empty()) {
    throw std::runtime_error(errors);
  }
  MovedMaps moved;
  for (const auto& answer : answers) {
    moved.maps += answer.response.maps_fetched;
    moved.bytes += answer.response.bytes_fetched;
  }
  return moved;
}

std::string MapNodes::commit(std::uint32_t epoch, bool commit) const {
  std::vector<std::string> names;
  CommitResampling::Request request;
  request.epoch = epoch;
  request.commit = commit;
  for (std::size_t k = 0; k < nodes_; ++k) names.push_back(service(k, "commit_resampling"));
  return errorsOf(callAll<CommitResampling>(
      names, std::vector<CommitResampling::Request>(nodes_, request), resampling_timeout_s_));
}

}  // namespace rbpf_node
