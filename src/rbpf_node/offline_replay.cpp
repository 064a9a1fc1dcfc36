#include "rbpf_node/offline_replay.hpp"

#include <ros/console.h>
#include <ros/init.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <stdexcept>

#include "rbpf_node/bag_mounts.hpp"

namespace rbpf_node {

namespace {

constexpr auto kPatience = std::chrono::seconds(5);  // with a turn, before it is spoken of

std::string namesOf(const std::vector<std::uint32_t>& nodes) {
  std::string names;
  for (const std::uint32_t node : nodes) {
    names += (names.empty() ? "svgp_node_" : ", svgp_node_") + std::to_string(node);
  }
  return names;
}

}  // namespace

OfflineReplay::OfflineReplay(ros::NodeHandle private_node, const Parameters& params, SlamNode* slam)
    : params_(params),
      slam_(*slam),
      door_(slam),
      record_(1.0 / params.publish_rate_hz),
      turns_(params.nodes, [] { return ros::isShuttingDown(); }),
      server_(private_node.advertiseService("take_turn", &OfflineReplay::take, this)) {}

double OfflineReplay::run(const OfflineParameters& offline) {
  rosbag::Bag bag;
  const OfflineTopics topics = openBag(offline.bag, offline.topics, &bag);
  if (offline.is_recorded) record_.awaitRecorder();
  if (mapping()) awaitNodes(0.0);
  progress_.start();
  const StampOrder order = inStampOrder(bag, topics, params_.gate.clock);
  expectTwistThatAgrees(order);
  slam_.intake().setClockOffset(order.clock_offset_s);
  slam_.intake().refuse(order.refused);
  const Mounts mounts = mountsIn(bag, params_.frames, order.ping_frames);
  setMounts(mounts.first, bag, &slam_.transforms());
  const double duration_s = order.end_s - order.begin_s;
  progress_.setDuration(duration_s);
  double survey_s = 0.0;
  for (const StampedMessage& message : order.messages) {
    if (ros::isShuttingDown()) throw std::runtime_error("interrupted");
    door_.takeIn(message.kind, rawMessage(message.instance), message.instance.getTime().toSec());
    if (message.kind != rbpf_core::InputKind::kFix) {  // it is no survey
      survey_s =
          std::max(survey_s, surveyTime(message.stamp.toSec() - order.begin_s, order.begin_s));
    }
    trainUpTo(survey_s);
    record_.advance(survey_s, [this] { return now(); });
    slam_.closeLoops();
    progress_.update(survey_s, [this] { return counts(); });
  }
  setMounts(mounts.changed, bag, &slam_.transforms());
  slam_.finish();
  const double wall_s = progress_.end(counts() + ", " + std::to_string(order.refused.total()) +
                                      " messages unreadable");
  trainFinally(survey_s);
  record_.add([this] { return now(); });
  return wall_s;
}

// A twist that contradicts the pose would lead the whole survey astray, and is known beforehand.
void OfflineReplay::expectTwistThatAgrees(const StampOrder& order) const {
  rbpf_core::InputGate gate(params_.gate, order.clock_offset_s);
  std::vector<rbpf_core::Odometry> odometry;
  for (const StampedMessage& message : order.messages) {
    if (message.kind != rbpf_core::InputKind::kOdometry) continue;
    try {
      const AnyInput input = readInput(message.kind, rawMessage(message.instance));
      const rbpf_core::Odometry one = toOdometry(std::get<OdometryInput>(input), params_.frames);
      const auto refusal = gate.check(one, message.instance.getTime().toSec());
      // rates in degrees are refused in every turn, which is where they show
      if (!refusal || refusal->reason() == rbpf_core::Reason::kImplausibleTwist) {
        odometry.push_back(one);
      }
    } catch (const std::exception&) {  // it will be refused, and counted, when it is taken in
    }
  }
  const auto finding = rbpf_core::twistAgainstPose(odometry, params_.filter.odometry.velocity);
  if (finding && finding->severity == rbpf_core::Severity::kError) {
    throw std::runtime_error(finding->name + ": " + finding->text);
  }
}

// Of a stamp, since the survey's begin, without gaps; what is refused takes no time.
double OfflineReplay::surveyTime(double since_begin_s, double begin_s) const {
  const rbpf_core::FilterSnapshot filter = slam_.filter().snapshot();
  return since_begin_s - filter.odometryUse().unsurveyedSeconds(begin_s + since_begin_s);
}

void OfflineReplay::trainFinally(double duration_s) {
  // without beams there is nothing to wait for
  if (!mapping() || slam_.filter().snapshot().beamsReleased() == 0) return;
  ROS_INFO("Survey over; training on the whole log, as much as in %.0f s of survey.",
           params_.final_training_s);
  // a second at a time, so that maps whose node has died are heard of soon
  for (double s = 0.0; s < params_.final_training_s;) {
    s = std::min(s + 1.0, params_.final_training_s);
    trainUpTo(duration_s + s);
  }
  // and if no round was due: maps take in what is held back no longer
  turns_.grant(0);
  awaitNodes(duration_s);
}

void OfflineReplay::trainUpTo(double survey_s) {
  if (!mapping()) return;
  if (slam_.filter().snapshot().beamsReleased() == 0) {
    first_beams_s_ = survey_s;
    return;
  }
  // A round is one step of each of the J maps.
  const double steps_due = params_.offline_steps_per_second * (survey_s - first_beams_s_);
  const auto rounds_due = static_cast<std::uint64_t>(
      std::floor(steps_due / static_cast<double>(params_.filter.particles)));
  // Before a prompt there is a turn even if no round is due: maps take in what has come, and nodes
  // say what has become of them in the last resampling.
  if (rounds_due == rounds_ && !slam_.loopClosing().isDue()) return;
  turns_.grant(static_cast<std::uint32_t>(rounds_due - rounds_));
  rounds_ = rounds_due;
  awaitNodes(survey_s);
}

void OfflineReplay::awaitNodes(double survey_s) {
  const auto start = std::chrono::steady_clock::now();
  const bool all_came = turns_.awaitAll([&](const std::vector<std::uint32_t>& busy) {
    const bool patient = std::chrono::steady_clock::now() - start < kPatience;
    progress_.update(survey_s, [&] { return patient ? counts() : "waiting for " + namesOf(busy); });
  });
  if (!all_came) throw std::runtime_error("interrupted");
  slam_.maps().takeStates(turns_.states());
}

std::string OfflineReplay::counts() const {
  const rbpf_core::FilterSnapshot filter = slam_.filter().snapshot();
  const rbpf_core::LoopClosing& loop_closing = slam_.loopClosing();
  return std::to_string(filter.pings()) + " pings, " + std::to_string(filter.beams()) + " beams, " +
         std::to_string(loop_closing.statistics().prompts) + " loop-closure prompts, " +
         std::to_string(loop_closing.epoch()) + " resamplings";
}

rbpf_svgp_slam::RecordSurvey::Request OfflineReplay::now() const {
  rbpf_svgp_slam::RecordSurvey::Request survey;
  survey.status = slam_.status();
  survey.maps = turns_.states();
  return survey;
}

bool OfflineReplay::take(rbpf_svgp_slam::TakeTurn::Request& request,
                         rbpf_svgp_slam::TakeTurn::Response& response) {
  try {
    const auto turn = turns_.take(request.status, request.turn);
    response.success = turn.has_value();
    response.turn = turn.value_or(Turn{}).number;
    response.rounds = turn.value_or(Turn{}).rounds;
    if (!turn) response.message = "the replay has ended";
  } catch (const std::invalid_argument& error) {
    response.message = error.what();
  }
  return true;
}

}  // namespace rbpf_node
