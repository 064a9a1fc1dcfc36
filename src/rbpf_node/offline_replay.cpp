#include "rbpf_node/offline_replay.hpp"

#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <tf2_msgs/TFMessage.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <stdexcept>
#include <thread>

namespace rbpf_node {

namespace {

using Clock = std::chrono::steady_clock;
constexpr auto kPoll = std::chrono::milliseconds(1);
constexpr double kPrintPeriod_s = 1.0;

// Prints "42 % of 20:00 min, 12.3 x real time, ETA 01:04" on one line, once a second.
class Progress {
 public:
  explicit Progress(double duration_s) : duration_s_(duration_s) {}

  void update(double survey_s) {
    const double wall_s = std::chrono::duration<double>(Clock::now() - start_).count();
    if (wall_s < next_print_s_ && survey_s < duration_s_) return;
    next_print_s_ = wall_s + kPrintPeriod_s;
    const double rate = survey_s / std::max(wall_s, 1e-3);
    const double left_s = (duration_s_ - survey_s) / std::max(rate, 1e-6);
    std::printf("\roffline replay: %5.1f %% of %.0f s, %.1f x real time, ETA %02d:%02d ",
                100.0 * survey_s / std::max(duration_s_, 1e-3), duration_s_, rate,
                static_cast<int>(left_s) / 60, static_cast<int>(left_s) % 60);
    if (survey_s >= duration_s_) std::printf("\n");
    std::fflush(stdout);
  }

 private:
  const double duration_s_;
  const Clock::time_point start_ = Clock::now();
  double next_print_s_ = 0.0;
};

void expectTopic(const rosbag::Bag& bag, const std::string& topic) {
  rosbag::View view(bag, rosbag::TopicQuery(topic));
  if (view.size() == 0) {
    throw std::runtime_error(bag.getFileName() + " holds no message on " + topic);
  }
}

void takeStaticTransforms(const rosbag::Bag& bag, SlamNode* slam) {
  for (const rosbag::MessageInstance& instance :
       rosbag::View(bag, rosbag::TopicQuery(std::string("/tf_static")))) {
    const auto message = instance.instantiate<tf2_msgs::TFMessage>();
    for (const auto& transform : message->transforms) {
      slam->transforms().setTransform(transform, instance.getCallerId(), true);
    }
  }
}

}  // namespace

void replayOffline(const std::string& bag_path, const OfflineTopics& topics,
                   const Parameters& params, SlamNode* slam) {
  const rosbag::Bag bag(bag_path, rosbag::bagmode::Read);
  expectTopic(bag, topics.odometry);
  expectTopic(bag, topics.pings);
  takeStaticTransforms(bag, slam);
  rosbag::View view(bag,
                    rosbag::TopicQuery(std::vector<std::string>{topics.odometry, topics.pings}));
  const ros::Time begin = view.getBeginTime();
  double first_beams_s = 0.0;
  Progress progress((view.getEndTime() - begin).toSec());
  for (const rosbag::MessageInstance& instance : view) {
    if (!ros::ok()) throw std::runtime_error("interrupted");
    const double survey_s = (instance.getTime() - begin).toSec();
    if (const auto odometry = instance.instantiate<nav_msgs::Odometry>()) {
      slam->handleOdometry(odometry);
    } else if (const auto ping = instance.instantiate<sensor_msgs::PointCloud2>()) {
      slam->handlePing(ping);
    }
    if (slam->filter().beamsReleased() == 0) first_beams_s = survey_s;
    const double steps_due = params.offline_steps_per_second * (survey_s - first_beams_s);
    while (ros::ok() && static_cast<double>(slam->services().minibatchesServed()) < steps_due) {
      std::this_thread::sleep_for(kPoll);
      progress.update(survey_s);
    }
    slam->loopClosureLoop().promptIfDue();
    progress.update(survey_s);
  }
}

}  // namespace rbpf_node
