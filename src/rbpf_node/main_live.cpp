// rbpf_core: the live node.
#include <ros/ros.h>
#include <tf2_ros/transform_listener.h>
#include <topic_tools/shape_shifter.h>

#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "rbpf_node/door.hpp"
#include "rbpf_node/spinning.hpp"
#include "rbpf_node/taken_name.hpp"

namespace {

// Messages; a busy moment must lose nothing.
constexpr std::uint32_t kInputQueue = 10000;
// Of the first message, for /clock under simulated time; ROS' own thread receives it.
constexpr double kClockPatience_s = 5.0;

// The time of a message that has just come. A bag's first one may overtake /clock: without a time
// of its receipt nobody could tell that its stamp is wrong.
double receiptTime() {
  static const bool has_clock = ros::Time::waitForValid(ros::WallDuration(kClockPatience_s));
  if (!has_clock) {
    ROS_WARN_ONCE("use_sim_time is set, but no /clock has come within %.0f s: stamps are trusted.",
                  kClockPatience_s);
  }
  return ros::Time::now().toSec();
}

// Messages of any type: the door knows which are understood.
ros::Subscriber subscribe(ros::NodeHandle node, const std::string& topic, rbpf_core::InputKind kind,
                          rbpf_node::Door* door) {
  return node.subscribe<topic_tools::ShapeShifter>(
      topic, kInputQueue, [kind, door](const topic_tools::ShapeShifter::ConstPtr& message) {
        door->takeIn(kind, rbpf_node::rawMessage(*message), receiptTime());
      });
}

ros::Subscriber subscribeInitialPose(ros::NodeHandle node, rbpf_node::Door* door) {
  using geometry_msgs::PoseWithCovarianceStamped;
  return node.subscribe<PoseWithCovarianceStamped>(
      "initialpose", 10, [door](const PoseWithCovarianceStamped::ConstPtr& message) {
        door->takeInitialPose(*message, receiptTime());
      });
}

// A survey from its start: all that it consists of is made anew for the next.
class Survey {
 public:
  Survey(rbpf_node::Spinning* spinning, const rbpf_node::Parameters& params,
         const rbpf_node::JournalParameters& journal)
      : slam_(spinning->node(), spinning->privateNode(), params, rbpf_node::Input::kLive, journal),
        transforms_(slam_.transforms()),
        door_(&slam_) {
    ros::NodeHandle& input = spinning->inputNode();
    subscribers_ = {subscribe(input, "odom", rbpf_core::InputKind::kOdometry, &door_),
                    subscribe(input, "mbes/pings", rbpf_core::InputKind::kPing, &door_),
                    subscribe(input, "fixes", rbpf_core::InputKind::kFix, &door_),
                    subscribeInitialPose(input, &door_)};
    slam_.maps().listen();
  }

  void closeLoops() { slam_.closeLoops(); }
  bool isMappingPaused() { return slam_.intake().state().mapping_paused; }

 private:
  rbpf_node::SlamNode slam_;
  const tf2_ros::TransformListener transforms_;
  rbpf_node::Door door_;
  std::vector<ros::Subscriber> subscribers_;
};

// Of who asks for another survey: a smoothing of the old one may be under way.
constexpr double kResetPatience_s = 300.0;

void run() {
  // Input has a thread of its own: it never waits for services, publications or the map nodes.
  rbpf_node::Spinning spinning;
  const auto params = rbpf_node::loadParameters(spinning.node());
  auto journal = rbpf_node::loadJournalParameters(spinning.node(), spinning.privateNode());
  auto survey = std::make_unique<Survey>(&spinning, params, journal);
  rbpf_node::AskedStep asked_reset("the reset");
  rbpf_node::TriggerServices triggers(spinning.privateNode());
  triggers.add("reset",
               [&](auto&) { return asked_reset.ask(kResetPatience_s, [] { return !ros::ok(); }); });
  // a map node asks for minibatches and for blocks of beams; one more each for who exports the
  // survey, and who waits for a prompt, a smoothing or a reset
  spinning.start(2 * params.nodes + 4);
  while (ros::ok()) {
    survey->closeLoops();
    if (asked_reset.isAsked()) {
      const bool was_paused = survey->isMappingPaused();
      survey.reset();  // at first: there is one of each topic and service
      if (!journal.path.empty()) {
        journal.resume = journal.overwrite = false;
        ROS_WARN("The journal so far is %s.", rbpf_node::setAside(journal.path).c_str());
      }
      survey = std::make_unique<Survey>(&spinning, params, journal);
      ROS_WARN("The survey starts over, as ~reset has asked.");
      asked_reset.answer({true, std::string("the survey starts over") +
                                    (was_paused ? "; pings are taken in again" : "")});
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  spinning.stop();
}

}  // namespace

int main(int argc, char** argv) {
  ros::init(argc, argv, "rbpf_core");
  // a limit on the size of files is to be as a full disk, which ends the journal and not the core
  std::signal(SIGXFSZ, SIG_IGN);
  try {
    rbpf_node::expectNameIsFree();
    run();
  } catch (const std::exception& error) {
    // rosconsole has been shut down with the last node handle
    std::fprintf(stderr, "[FATAL] %s: %s\n", argv[0], error.what());
    return EXIT_FAILURE;
  }
  return EXIT_SUCCESS;
}
