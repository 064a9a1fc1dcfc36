// rbpf_core: the live node.
#include <ros/ros.h>
#include <tf2_ros/transform_listener.h>

#include <cstdio>
#include <cstdlib>
#include <thread>

#include "rbpf_node/node.hpp"
#include "rbpf_node/spinning.hpp"

namespace {

constexpr std::uint32_t kInputQueue = 10000;  // messages; a busy moment must lose nothing

}  // namespace

int main(int argc, char** argv) {
  ros::init(argc, argv, "rbpf_core");
  try {
    // Input has a thread of its own: it never waits for services, publications or the map nodes.
    rbpf_node::Spinning spinning;
    const auto params = rbpf_node::loadParameters(spinning.node());
    rbpf_node::SlamNode slam(spinning.node(), spinning.privateNode(), params,
                             rbpf_node::Input::kLive);
    const tf2_ros::TransformListener listener(slam.transforms());
    ros::NodeHandle input = spinning.inputNode();
    const auto odometry =
        input.subscribe("odom", kInputQueue, &rbpf_node::SlamNode::handleOdometry, &slam);
    const auto pings =
        input.subscribe("mbes/pings", kInputQueue, &rbpf_node::SlamNode::handlePing, &slam);
    slam.maps().listen();
    // a map node asks for minibatches and for blocks of beams; one more for who exports the survey
    spinning.start(2 * params.nodes + 1);
    while (ros::ok()) {
      slam.closeLoops();
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    spinning.stop();
  } catch (const std::exception& error) {
    // rosconsole has been shut down with the last node handle
    std::fprintf(stderr, "[FATAL] %s: %s\n", argv[0], error.what());
    return EXIT_FAILURE;
  }
  return EXIT_SUCCESS;
}
