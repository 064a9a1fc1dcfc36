#include "rbpf_node/progress_line.hpp"

#include <algorithm>
#include <cstdio>

namespace rbpf_node {

namespace {

constexpr auto kPrintPeriod = std::chrono::seconds(1);
constexpr double kInstant_s = 1e-3;  // in place of a time of zero, to divide by

}  // namespace

bool ProgressLine::isDue() {
  const auto now = Clock::now();
  if (now < next_print_) return false;
  next_print_ = now + kPrintPeriod;
  return true;
}

std::string ProgressLine::progress(double survey_s) const {
  const double rate = survey_s / std::max(wall_s(), kInstant_s);
  char eta[16] = "--:--";
  if (rate > 0.0) {
    const double longest_s = 99 * 60 + 59;
    const int left_s =
        static_cast<int>(std::clamp((duration_s_ - survey_s) / rate, 0.0, longest_s));
    std::snprintf(eta, sizeof(eta), "%02d:%02d", left_s / 60, left_s % 60);
  }
  char text[128];
  std::snprintf(text, sizeof(text), "%5.1f %% of %.0f s, %.1f x real time, ETA %s | ",
                100.0 * survey_s / duration_s_, duration_s_, rate, eta);
  return text;
}

void ProgressLine::print(double survey_s, const std::string& what) {
  const std::string line = (duration_s_ > 0.0 ? progress(survey_s) : "") + what;
  std::printf("\roffline replay: %-*s", static_cast<int>(printed_), line.c_str());
  printed_ = line.size();
  std::fflush(stdout);
}

double ProgressLine::end(const std::string& what) {
  const double taken_s = wall_s();
  std::printf("\noffline replay: %.1f s of survey in %.2f s, %.1f x real time; %s\n", duration_s_,
              taken_s, duration_s_ / std::max(taken_s, kInstant_s), what.c_str());
  std::fflush(stdout);
  duration_s_ = 0.0;  // what comes now is beyond the survey
  printed_ = 0;
  return taken_s;
}

}  // namespace rbpf_node
