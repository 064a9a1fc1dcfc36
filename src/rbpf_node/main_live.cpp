// rbpf_core: the live node.
#include <ros/ros.h>
#include <tf2_ros/transform_listener.h>
#include <topic_tools/shape_shifter.h>

#include <cstdio>
#include <cstdlib>
#include <thread>

#include "rbpf_node/door.hpp"
#include "rbpf_node/spinning.hpp"

namespace {

// Messages; a busy moment must lose nothing.
constexpr std::uint32_t kInputQueue = 10000;

// Messages of any type: the door knows which are understood.
ros::Subscriber subscribe(ros::NodeHandle node, const std::string& topic, rbpf_core::InputKind kind,
                          rbpf_node::Door* door) {
  return node.subscribe<topic_tools::ShapeShifter>(
      topic, kInputQueue, [kind, door](const topic_tools::ShapeShifter::ConstPtr& message) {
        door->takeIn(kind, rbpf_node::rawMessage(*message), ros::Time::now().toSec());
      });
}

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
    rbpf_node::Door door(&slam);
    ros::NodeHandle& input = spinning.inputNode();
    const auto odometry = subscribe(input, "odom", rbpf_core::InputKind::kOdometry, &door);
    const auto pings = subscribe(input, "mbes/pings", rbpf_core::InputKind::kPing, &door);
    const auto fixes = subscribe(input, "fixes", rbpf_core::InputKind::kFix, &door);
    slam.maps().listen();
    // a map node asks for minibatches and for blocks of beams; one more each for who exports the
    // survey, and who waits for a prompt or a smoothing
    spinning.start(2 * params.nodes + 3);
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
