// Stands in for rbpf_core: the same filter, services and loop closing, on a survey made up in
// memory to any length within seconds. Prompts and resamplings happen when they are asked for.
//   ~grow       takes in pings until the log holds ~beams beams (parameter)
//   ~prompt     one prompt with the latest ping
//   ~resample   one resampling that replaces half of the particles
// Each is a std_srvs/Trigger that answers with one line of JSON.
#include <ros/ros.h>
#include <std_srvs/Trigger.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <sstream>

#include "rbpf_core/loop_closing.hpp"
#include "rbpf_node/map_nodes.hpp"
#include "rbpf_node/services.hpp"
#include "rbpf_node/spinning.hpp"
#include "synthetic_survey.hpp"

namespace {

using std_srvs::Trigger;

constexpr double kPingPeriod_s = 0.1;
constexpr double kRadius_m = 60.0;  // a circle round (0, 0), so that seabed is seen again
constexpr double kTurn_radps = 0.03;
constexpr double kDepth_m = 20.0;  // below the vehicle, on average

// The seabed below the vehicle, 2 m of relief.
float seabed(double x_m, double y_m) {
  return static_cast<float>(-kDepth_m + 2.0 * std::sin(x_m / 15.0) * std::cos(y_m / 20.0));
}

rbpf_core::Pose2 poseAt(double t_s) {
  const double turned_rad = kTurn_radps * t_s;
  return {kRadius_m * std::sin(turned_rad), -kRadius_m * std::cos(turned_rad), turned_rad};
}

rbpf_core::Odometry odometryAt(double t_s) {
  rbpf_core::Odometry odometry;
  odometry.stamp_s = t_s;
  odometry.pose = poseAt(t_s);
  odometry.linear_mps = {kRadius_m * kTurn_radps, 0.0, 0.0};
  odometry.angular_radps = {0.0, 0.0, kTurn_radps};
  return odometry;
}

// Across the track, over 120 degrees.
rbpf_core::Ping pingAt(double t_s, Eigen::Index beams) {
  rbpf_core::Ping ping;
  ping.stamp_s = t_s;
  ping.beams_m.resize(3, beams);
  const rbpf_core::Pose2 pose = poseAt(t_s);
  for (Eigen::Index i = 0; i < beams; ++i) {
    const double share = static_cast<double>(i) / (beams - 1) - 0.5;
    const double left_m = kDepth_m * std::tan(share * 2.0 * M_PI / 3.0);
    const double x_m = pose.x_m - std::sin(pose.yaw_rad) * left_m;
    const double y_m = pose.y_m + std::cos(pose.yaw_rad) * left_m;
    ping.beams_m.col(i) << 0.0F, static_cast<float>(left_m), seabed(x_m, y_m);
  }
  return ping;
}

class FilterNode {
 public:
  FilterNode(rbpf_node::Spinning* spinning, const rbpf_node::Parameters& params)
      : own_(spinning->privateNode()),
        ping_beams_(own_.param("ping_beams", 512)),
        filter_(params.filter),
        maps_(spinning->node(), params),
        loop_closing_(filter_, maps_, {0.0, params.loop_closure, {}}),
        smoothing_(&filter_, params.smoothing, rbpf_node::Input::kLive, [] { return false; }),
        services_(own_, 0, filter_, loop_closing_, smoothing_),
        servers_{own_.advertiseService("grow", &FilterNode::grow, this),
                 own_.advertiseService("prompt", &FilterNode::prompt, this),
                 own_.advertiseService("resample", &FilterNode::resample, this)} {}

 private:
  static void expectDone(const rbpf_core::StepResult& result) {
    if (!result.problem.empty()) throw std::runtime_error(result.problem);
  }

  template <typename Work>
  static bool answer(Trigger::Response* response, const Work& work) {
    const auto start = std::chrono::steady_clock::now();
    std::ostringstream json;
    try {
      work(&json);
    } catch (const std::exception& error) {
      response->message = error.what();
      return true;
    }
    const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - start;
    response->success = true;
    response->message = "{\"wall_s\": " + std::to_string(taken.count()) + json.str() + "}";
    return true;
  }

  bool grow(Trigger::Request&, Trigger::Response& response) {
    return answer(&response, [this](std::ostringstream* json) {
      const auto beams = static_cast<std::size_t>(own_.param("beams", 0));
      for (; filter_.snapshot().beams() < beams; t_s_ += kPingPeriod_s) {
        filter_.addOdometry(odometryAt(t_s_));
        filter_.addPing(pingAt(t_s_, ping_beams_));
      }
      const rbpf_core::FilterSnapshot snapshot = filter_.snapshot();
      *json << ", \"beams\": " << snapshot.beams() << ", \"pings\": " << snapshot.pings();
    });
  }

  bool prompt(Trigger::Request&, Trigger::Response& response) {
    return answer(&response, [this](std::ostringstream* json) {
      expectDone(loop_closing_.weigh(filter_.snapshot().latestPing().value()));
      *json << ", \"outcome\": \"" << loop_closing_.statistics().message << "\"";
    });
  }

  bool resample(Trigger::Request&, Trigger::Response& response) {
    return answer(&response, [this](std::ostringstream* json) {
      // half of the particles, chosen at random, have two offspring each, the others none
      std::vector<std::uint32_t> offspring(filter_.params().particles, 0);
      for (std::size_t left = offspring.size() / 2; left > 0;) {
        std::uint32_t& chosen = offspring[stream_.below(offspring.size())];
        if (chosen > 0) continue;
        chosen = 2;
        --left;
      }
      if (offspring.size() % 2 == 1) ++offspring.back();
      const auto before = loop_closing_.statistics();
      expectDone(loop_closing_.resample(rbpf_core::numberOffspring(offspring, maps_.nodeOf())));
      const auto after = loop_closing_.statistics();
      *json << ", \"maps_moved\": " << after.moved.maps - before.moved.maps
            << ", \"bytes_moved\": " << after.moved.bytes - before.moved.bytes;
    });
  }

  ros::NodeHandle own_;
  const Eigen::Index ping_beams_;
  rbpf_core::ParticleFilter filter_;
  rbpf_node::MapNodes maps_;
  rbpf_core::LoopClosing loop_closing_;
  rbpf_node::SmoothingWorker smoothing_;  // never at work
  rbpf_node::Services services_;
  ros::ServiceServer servers_[3];
  rbpf_core::RandomStream stream_{1};
  double t_s_ = 1.0;  // of the next ping
};

}  // namespace

int main(int argc, char** argv) {
  ros::init(argc, argv, "rbpf_core");
  try {
    rbpf_node::Spinning spinning;
    const auto params = rbpf_node::loadParameters(spinning.node());
    FilterNode node(&spinning, params);
    spinning.start(2 * params.nodes + 1);
    ros::waitForShutdown();
    spinning.stop();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "[FATAL] %s: %s\n", argv[0], error.what());
    return EXIT_FAILURE;
  }
  return EXIT_SUCCESS;
}
