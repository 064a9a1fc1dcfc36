#include "rbpf_node/progress_line.hpp"

#include <algorithm>
#include <cstdio>

namespace rbpf_node {

namespace {

constexpr double kPrintPeriod_s = 1.0;
constexpr double kInstant_s = 1e-3;  // in place of a time of zero, to divide by

}  // namespace

bool ProgressLine::isDue() {
  const double now_s = wall_s();
  if (now_s < next_print_s_) return false;
  next_print_s_ = now_s + kPrintPeriod_s;
  return true;
}

void ProgressLine::print(double survey_s, const std::string& what) {
  const double rate = survey_s / std::max(wall_s(), kInstant_s);
  char eta[16] = "--:--";
  if (rate > 0.0) {
    const int left_s = static_cast<int>((duration_s_ - survey_s) / rate);
    std::snprintf(eta, sizeof(eta), "%02d:%02d", left_s / 60, left_s % 60);
  }
  const int printed = std::printf(
      "\roffline replay: %5.1f %% of %.0f s, %.1f x real time, ETA %s | %s",
      100.0 * survey_s / std::max(duration_s_, kInstant_s), duration_s_, rate, eta, what.c_str());
  std::printf("%*s", std::max(0, printed_ - printed), "");  // over the rest of a longer line
  printed_ = printed;
  std::fflush(stdout);
}

double ProgressLine::end(const std::string& what) const {
  const double taken_s = wall_s();
  std::printf("\noffline replay: %.1f s of survey in %.2f s, %.1f x real time; %s\n", duration_s_,
              taken_s, duration_s_ / std::max(taken_s, kInstant_s), what.c_str());
  std::fflush(stdout);
  return taken_s;
}

}  // namespace rbpf_node
