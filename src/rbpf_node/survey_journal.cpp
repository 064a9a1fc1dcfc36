#include "rbpf_node/survey_journal.hpp"

#include <ros/console.h>

#include <chrono>
#include <filesystem>

#include "rbpf_core/journal/filter_settings.hpp"
#include "rbpf_node/parameter_reader.hpp"
#include "rbpf_node/parameters.hpp"

namespace rbpf_node {

using rbpf_core::JournalWriter;

namespace {

void tellFailure(const std::string& why) {
  ROS_ERROR("%s. SLAM goes on; what has been written stays, and the survey can be resumed from it.",
            why.c_str());
}

}  // namespace

JournalParameters validJournalParameters(XmlRpc::XmlRpcValue tree) {
  ParameterReader reader(tree);
  JournalParameters params;
  const XmlRpc::XmlRpcValue& journal = tree["~journal"];
  const bool is_none = journal.getType() == XmlRpc::XmlRpcValue::TypeString &&
                       static_cast<const std::string&>(journal).empty();
  if (!is_none) params.path = reader.text("~journal");
  params.resume = reader.boolean("~resume");
  params.overwrite = reader.boolean("~overwrite");
  if (!params.path.empty() && params.path.front() != '/') {
    ParameterReader::fail("~journal", params.path, "an absolute path: nodes run in ROS's folder");
  }
  if (params.resume && params.path.empty()) {
    ParameterReader::fail("~resume", "true", "false where there is no ~journal");
  }
  return params;
}

JournalParameters loadJournalParameters(const ros::NodeHandle& node,
                                        const ros::NodeHandle& private_node) {
  XmlRpc::XmlRpcValue tree;
  tree["~journal"] = std::string();
  tree["~resume"] = false;
  tree["~overwrite"] = false;
  for (auto& [name, value] : tree) private_node.getParam(name.substr(1), value);
  JournalParameters params = validJournalParameters(tree);
  params.program = parametersAsXml(node);
  return params;
}

void refuseEarlierRun(const std::string& journal) {
  for (const std::string name : {"report.json", "survey.npz", "trajectory.tum"}) {
    const std::filesystem::path file = std::filesystem::path(journal).parent_path() / name;
    if (!std::filesystem::exists(file)) continue;
    throw std::runtime_error("the run folder has " + file.string() +
                             " of an earlier run; expected none, or overwrite:=true, which loses "
                             "that run");
  }
}

std::string setAside(const std::string& path) {
  int number = 1;
  while (std::filesystem::exists(path + "." + std::to_string(number))) ++number;
  const std::string aside = path + "." + std::to_string(number);
  std::filesystem::rename(path, aside);
  return aside;
}

SurveyJournal::SurveyJournal(const JournalParameters& params,
                             const rbpf_core::ProgramSettings& settings,
                             rbpf_core::ParticleFilter* filter,
                             rbpf_core::LoopClosing* loop_closing)
    : path_(params.path), filter_(*filter), loop_closing_(*loop_closing) {
  if (params.resume) {
    resume();
  } else {
    // one with a journal is refused by that
    if (!params.overwrite && !std::filesystem::exists(path_)) refuseEarlierRun(path_);
    writer_ = std::make_unique<JournalWriter>(
        path_,
        params.overwrite ? JournalWriter::Existing::kOverwrite : JournalWriter::Existing::kRefuse,
        tellFailure);
    writer_->onChange(rbpf_core::settingsOf(filter_.params()));
  }
  writer_->onChange(settings);
  writer_->settle();
  filter_.observe(writer_.get());
  loop_closing_.observe(writer_.get());
}

SurveyJournal::~SurveyJournal() {
  filter_.observe(nullptr);
  loop_closing_.observe(nullptr);
}

void SurveyJournal::resume() {
  const auto start = std::chrono::steady_clock::now();
  const rbpf_core::ResumedSurvey survey = rbpf_core::resumeFrom(path_, &filter_);
  filter_.goOn();
  loop_closing_.resume(survey.epoch, survey.loop_closing);
  resumed_ = survey.programs;
  writer_ = std::make_unique<JournalWriter>(path_, survey.whole_bytes, tellFailure);
  const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - start;
  const rbpf_core::FilterSnapshot snapshot = filter_.snapshot();
  ROS_INFO(
      "Resumed %s: %zu pings and %.0f s of survey, %u resamplings, %u corrections of the past that "
      "maps follow; the last odometry is of %.3f s. %zu records, %.1f MB, read in %.1f s.",
      path_.c_str(), snapshot.pings(), snapshot.odometryUse().surveySeconds(), survey.epoch,
      snapshot.past(), snapshot.estimate().stamp_s, survey.records,
      static_cast<double>(survey.whole_bytes) / 1e6, taken.count());
  if (!survey.lost_tail) return;
  ROS_WARN("The last %lu bytes of the journal are lost, %zu records at least: %s.",
           static_cast<unsigned long>(survey.lost_tail->bytes), survey.lost_tail->records,
           survey.lost_tail->why.c_str());
}

}  // namespace rbpf_node
