// /diagnostics: what is known of a survey under way, judged by the rules of health_rules.hpp.
#pragma once

#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/node_handle.h>

#include <atomic>
#include <functional>
#include <optional>

#include "rbpf_core/loop_closing.hpp"
#include "rbpf_node/health_rules.hpp"
#include "rbpf_node/intake.hpp"
#include "rbpf_node/map_nodes.hpp"
#include "rbpf_node/survey_journal.hpp"
#include "rbpf_svgp_slam/FilterStatus.h"

namespace rbpf_node {

class Diagnostics {
 public:
  // Outlive it.
  struct Sources {
    const Parameters& params;
    const Input input;
    const Intake& intake;
    const MapNodes& maps;
    const rbpf_core::LoopClosing& loop_closing;
    const std::optional<SurveyJournal>& journal;
    const std::function<rbpf_svgp_slam::FilterStatus()> status;
  };

  Diagnostics(const ros::NodeHandle& node, const ros::NodeHandle& private_node, Sources sources);

  // Publishes them if that is due. To be called by one thread, more than once a second.
  void update() { updater_.update(); }

  // The survey is over: silence is no longer spoken of.
  void expectNoMoreInput() { is_over_ = true; }

 private:
  using Report = diagnostic_updater::DiagnosticStatusWrapper;

  void reportInput(Report& report);
  void reportSurvey(Report& report) const;
  void reportFilter(Report& report);
  void reportMaps(Report& report);
  void reportJournal(Report& report) const;
  void reportMachine(Report& report) const;

  const Sources sources_;
  const ros::WallTime start_;
  std::atomic<bool> is_over_{false};
  StreamHealth odometry_;
  StreamHealth pings_;
  PromptHealth prompts_;
  Watched resamplings_;
  diagnostic_updater::Updater updater_;
};

}  // namespace rbpf_node
