// The recorder of an offline replay is told how the survey stands at fixed times of the survey.
#pragma once

#include <ros/service_client.h>

#include <functional>
#include <optional>

#include "rbpf_svgp_slam/RecordSurvey.h"

namespace rbpf_node {

class SurveyRecord {
 public:
  explicit SurveyRecord(double period_s) : period_s_(period_s) {}

  // Until the recorder is there; without that nothing is recorded. Throws std::runtime_error when
  // interrupted.
  void awaitRecorder();

  // Returns once all is recorded that is due at that time of the survey. `now`: how it stands.
  // Throws std::runtime_error if the recorder fails.
  using Now = std::function<rbpf_svgp_slam::RecordSurvey::Request()>;
  void advance(double survey_s, const Now& now);

  // The last one, at the end.
  void add(const Now& now);

 private:
  const double period_s_;
  // survey time from which on the next one is due
  double next_s_ = 0.0;
  std::optional<ros::ServiceClient> recorder_;
};

}  // namespace rbpf_node
