// rbpf_offline: the live node's handlers, fed from a bag without loss. Runs under the live node's
// name, so that map nodes and recorder find it where they always do, and stays until shut down.
#include <ros/ros.h>

#include <cstdio>
#include <cstdlib>
#include <memory>

#include "rbpf_node/node.hpp"
#include "rbpf_node/offline_replay.hpp"
#include "rbpf_node/spinning.hpp"
#include "rbpf_node/taken_name.hpp"

namespace {

// Replays, tells the recorder by parameters how it went, and stays until the launch is ended: the
// recorder has the last word. Returns the exit status.
template <typename Replay>
int tell(const ros::NodeHandle& own, const Replay& replay) {
  std::string problem;
  try {
    own.setParam("replay_wall_s", replay());
  } catch (const std::exception& error) {
    if (ros::isShuttingDown()) throw;
    problem = error.what();
    ROS_ERROR("%s", problem.c_str());
  }
  own.setParam("replay_problem", problem);
  own.setParam("replay_finished", true);  // the recorder waits for this
  ros::waitForShutdown();
  return problem.empty() ? EXIT_SUCCESS : EXIT_FAILURE;
}

}  // namespace

int main(int argc, char** argv) {
  ros::init(argc, argv, "rbpf_core");
  try {
    rbpf_node::expectNameIsFree();
    rbpf_node::Spinning spinning;
    ros::NodeHandle& own = spinning.privateNode();
    const auto offline = rbpf_node::loadOfflineParameters(own);
    const auto params = rbpf_node::loadParameters(spinning.node());
    rbpf_node::SlamNode slam(spinning.node(), spinning.privateNode(), params,
                             rbpf_node::Input::kBag);
    rbpf_node::OfflineReplay replay(own, params, &slam);
    // a map node may wait for its turn while an earlier call, cut off, still waits
    spinning.start(2 * params.nodes + 1);
    // however this ends, nobody may be called back once the members are gone
    const auto stop = [&](void*) {
      replay.close();
      spinning.stop();
    };
    const std::unique_ptr<void, decltype(stop)> stop_at_end(&spinning, stop);
    return tell(own, [&] { return replay.run(offline); });
  } catch (const std::exception& error) {
    // rosconsole has been shut down with the last node handle
    std::fprintf(stderr, "[FATAL] %s: %s\n", argv[0], error.what());
    return EXIT_FAILURE;
  }
  return EXIT_SUCCESS;
}
