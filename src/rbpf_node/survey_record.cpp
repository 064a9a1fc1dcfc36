#include "rbpf_node/survey_record.hpp"

#include <ros/node_handle.h>
#include <ros/service.h>

#include <stdexcept>
#include <string>

namespace rbpf_node {

void SurveyRecord::awaitRecorder() {
  ros::NodeHandle node;
  const std::string service = node.resolveName("survey_recorder/record");
  if (!ros::service::waitForService(service)) throw std::runtime_error("interrupted");
  recorder_ = node.serviceClient<rbpf_svgp_slam::RecordSurvey>(service, true);
}

void SurveyRecord::advance(double survey_s, const Now& now) {
  if (survey_s < next_s_) return;
  next_s_ = survey_s + period_s_;
  add(now);
}

void SurveyRecord::add(const Now& now) {
  if (!recorder_) return;
  rbpf_svgp_slam::RecordSurvey survey;
  survey.request = now();
  if (!recorder_->call(survey)) throw std::runtime_error("the recorder has failed");
}

}  // namespace rbpf_node
