// One line on the terminal about a replay, rewritten once a second.
#pragma once

#include <chrono>
#include <string>

namespace rbpf_node {

class ProgressLine {
 public:
  // Measures the replay's wall time from here.
  void start() { start_ = Clock::now(); }
  void setDuration(double duration_s) { duration_s_ = duration_s; }

  // "42.0 % of 1200 s, 12.3 x real time, ETA 01:04 | what()", if a second has passed since the
  // last; what() alone as long as the duration is not known.
  template <typename What>
  void update(double survey_s, const What& what) {
    if (isDue()) print(survey_s, what());
  }

  // Leaves the line and writes the totals below it. Returns the replay's wall time, s.
  double end(const std::string& what);

 private:
  double wall_s() const { return std::chrono::duration<double>(Clock::now() - start_).count(); }
  bool isDue();
  std::string progress(double survey_s) const;
  void print(double survey_s, const std::string& what);

  using Clock = std::chrono::steady_clock;
  Clock::time_point start_ = Clock::now();
  Clock::time_point next_print_;
  double duration_s_ = 0.0;
  std::size_t printed_ = 0;  // characters on the line, to be written over
};

}  // namespace rbpf_node
