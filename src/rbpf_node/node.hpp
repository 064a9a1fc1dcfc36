// The SLAM node: inputs, filter, loop closing, messages out. What comes in has passed the same
// door, live and in an offline replay.
#pragma once

#include <ros/callback_queue.h>
#include <ros/node_handle.h>
#include <tf2_ros/buffer.h>

#include <atomic>

#include "rbpf_core/loop_closing.hpp"
#include "rbpf_node/diagnostics.hpp"
#include "rbpf_node/intake.hpp"
#include "rbpf_node/map_nodes.hpp"
#include "rbpf_node/publishers.hpp"
#include "rbpf_node/services.hpp"
#include "rbpf_node/smoothing_worker.hpp"
#include "rbpf_node/survey_journal.hpp"
#include "rbpf_node/trigger_services.hpp"

namespace rbpf_node {

class SlamNode {
 public:
  // Timers go on `node`'s callback queue, services on `private_node`'s.
  // journal: of a live node; its survey is resumed before anything is taken in, if so told. Throws
  // as SurveyJournal does.
  SlamNode(ros::NodeHandle node, ros::NodeHandle private_node, const Parameters& params,
           Input input, const JournalParameters& journal = {});
  // Waits for a smoothing that is under way; nobody who waits for a step gets it.
  ~SlamNode() { ends_ = true; }

  // receipt_s: when the message came, or was recorded. Throws Refusal.
  void handle(const OdometryInput& input, double receipt_s);
  void handle(PingInput input, double receipt_s);
  void handle(const FixInput& input, double receipt_s);

  // A step of Algorithm 2, if one is due or asked for, and the smoothing of the past; waits for the
  // map nodes, and logs what goes wrong. To be called from one thread, as often as you like.
  void closeLoops();

  // The survey is over; from a bag, the past is smoothed once more before it returns.
  void finish();

  Intake& intake() { return intake_; }
  tf2_ros::Buffer& transforms() { return transforms_; }
  MapNodes& maps() { return maps_; }
  const rbpf_core::LoopClosing& loopClosing() const { return loop_closing_; }
  const rbpf_core::ParticleFilter& filter() const { return filter_; }
  rbpf_svgp_slam::FilterStatus status() const;

 private:
  void keepJournal(const JournalParameters& params);
  bool haveMapsFollowed() const;
  void advertiseTriggers();
  Answer finishAndWait(std::uint64_t survey);
  Answer promptNow();
  Answer pauseMapping(bool pause);
  void publishOverview();
  void tellInput(const rbpf_core::FilterSnapshot& filter,
                 rbpf_svgp_slam::FilterStatus* status) const;
  void tellLoopClosing(rbpf_svgp_slam::FilterStatus* status) const;

  const Parameters params_;
  const std::uint64_t survey_;
  rbpf_core::ParticleFilter filter_;
  MapNodes maps_;
  rbpf_core::LoopClosing loop_closing_;
  std::optional<SurveyJournal> journal_;
  const Input input_;
  SmoothingWorker smoothing_;
  AskedStep asked_prompt_{"the prompt"};
  Services services_;
  Publishers publishers_;
  tf2_ros::Buffer transforms_;

  Intake intake_;
  Diagnostics diagnostics_;

  std::atomic<bool> ends_{false};
  TriggerServices triggers_;
  // last: what it calls needs all of the above
  ros::WallTimer overview_timer_;
};

}  // namespace rbpf_node
