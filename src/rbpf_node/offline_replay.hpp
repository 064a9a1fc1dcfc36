// A bag read directly: nothing is lost, whatever the speed, and nothing depends on wall time.
#pragma once

#include <ros/service_server.h>

#include <cstdint>
#include <string>
#include <vector>

#include "rbpf_node/door.hpp"
#include "rbpf_node/progress_line.hpp"
#include "rbpf_node/stamp_order.hpp"
#include "rbpf_node/survey_record.hpp"
#include "rbpf_node/turns.hpp"
#include "rbpf_svgp_slam/TakeTurn.h"

namespace rbpf_node {

class OfflineReplay {
 public:
  // Advertises ~take_turn on `private_node`'s callback queue, of which every map node may hold one
  // thread for any time.
  OfflineReplay(ros::NodeHandle private_node, const Parameters& params, SlamNode* slam);
  ~OfflineReplay() { close(); }

  // Tells the map nodes that wait for a turn that there is none. To be called before their callback
  // queue is stopped.
  void close() { turns_.close(); }

  // Hands the bag's messages, in the order of their stamps, to the node's handlers. In between it
  // grants the map nodes their turns, offline/steps_per_second optimizer steps for every second of
  // survey since there were beams to train on (0: it waits for no node), and prompts when that is
  // due; a recorder that takes part is told how the survey stands, output/publish_rate_hz times a
  // second of survey. At the end it grants the steps of output/final_training_s more. Prints
  // progress. Returns the wall time, s, that the survey took, final training not included. Throws
  // std::runtime_error if the bag cannot be read or lacks a topic, and when interrupted.
  double run(const OfflineParameters& offline);

 private:
  bool mapping() const { return params_.offline_steps_per_second > 0.0; }
  void expectTwistThatAgrees(const StampOrder& order) const;
  double surveyTime(double since_begin_s, double begin_s) const;
  void trainFinally(double duration_s);
  void trainUpTo(double survey_s);
  void awaitNodes(double survey_s);
  std::string counts() const;
  rbpf_svgp_slam::RecordSurvey::Request now() const;
  bool take(rbpf_svgp_slam::TakeTurn::Request& request,
            rbpf_svgp_slam::TakeTurn::Response& response);

  const Parameters params_;
  SlamNode& slam_;
  Door door_;
  ProgressLine progress_;
  // survey time when maps had nothing to train on for the last time
  double first_beams_s_ = 0.0;
  // granted
  std::uint64_t rounds_ = 0;
  SurveyRecord record_;
  Turns turns_;
  ros::ServiceServer server_;
};

}  // namespace rbpf_node
