// What a journal costs over a survey: space, processor time, and the time to resume from it; as one
// line of JSON.
//   bench_journal FILE PARTICLES PINGS_PER_S BEAMS HOURS
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <string>
#include <vector>

#include "rbpf_core/journal/filter_settings.hpp"
#include "rbpf_core/journal/journal_format.hpp"
#include "rbpf_core/journal/journal_writer.hpp"
#include "rbpf_core/journal/resume.hpp"

namespace {

using Clock = std::chrono::steady_clock;

struct Survey {
  std::size_t particles;
  double pings_per_s;
  Eigen::Index beams;
  double hours;
};

// Of all threads.
double processorSeconds() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

rbpf_core::FilterParams paramsOf(const Survey& survey) {
  rbpf_core::FilterParams params;
  params.particles = survey.particles;
  return params;
}

rbpf_core::Odometry odometryAt(double stamp_s) {
  rbpf_core::Odometry odometry;
  odometry.stamp_s = stamp_s;
  odometry.attitude.z_m = -10.0;
  odometry.linear_mps = {2.0, 0.0, 0.0};
  odometry.angular_radps = {0.0, 0.0, 0.01};
  return odometry;
}

rbpf_core::Ping pingAt(double stamp_s, Eigen::Index beams) {
  rbpf_core::Ping ping;
  ping.stamp_s = stamp_s;
  ping.beams_m.resize(3, beams);
  for (Eigen::Index i = 0; i < beams; ++i) {
    ping.beams_m.col(i) << 0.0F, 0.2F * static_cast<float>(i - beams / 2), -20.0F;
  }
  return ping;
}

// Of a correction every motion of the last ten minutes is told, in which particles differ, and one
// of so many before: as replays of the demo's survey have it.
constexpr double kLast_s = 600.0;
constexpr std::size_t kOneOf = 10;

// As an SLAM run does: weights every 5 s, and every 30 s a resampling and a correction of the whole
// past.
void decide(int second, double pings_per_s, rbpf_core::ParticleFilter* filter) {
  const auto J = static_cast<Eigen::Index>(filter->params().particles);
  if (second % 5 == 0) filter->setLogWeights(Eigen::ArrayXd::Constant(J, -std::log(double(J))));
  if (second % 30 != 0) return;
  std::vector<std::uint32_t> ancestors(filter->params().particles);
  for (std::uint32_t j = 0; j < ancestors.size(); ++j) ancestors[j] = j / 2 * 2;
  filter->resample(ancestors);
  rbpf_core::PastCorrection correction;
  const std::size_t pings = filter->snapshot().pings();
  const auto last = static_cast<std::size_t>(kLast_s * pings_per_s);
  for (std::size_t i = 0; i < pings; i += i + last < pings ? kOneOf : 1) {
    const double x = 1e-3 * static_cast<double>(i);
    correction.of_pings.push_back({i, {0.1 * std::sin(x), 0.1 * std::cos(x), 1e-4 * std::sin(x)}});
  }
  if (pings > 0) correction.of_rest = correction.of_pings.back().motion;
  filter->correctPast(correction);
}

void sail(const Survey& survey, rbpf_core::ParticleFilter* filter) {
  constexpr double kOdometryHz = 10.0;
  double next_ping_s = 0.0;
  for (int k = 0; k < static_cast<int>(survey.hours * 3600.0 * kOdometryHz); ++k) {
    const double now_s = 1000.0 + k / kOdometryHz;
    filter->addOdometry(odometryAt(now_s));
    for (; next_ping_s <= k / kOdometryHz; next_ping_s += 1.0 / survey.pings_per_s) {
      filter->addPing(pingAt(1000.0 + next_ping_s, survey.beams));
    }
    if (k % 10 == 0) decide(k / 10, survey.pings_per_s, filter);
  }
}

double processorSecondsOf(const Survey& survey, rbpf_core::ChangeObserver* observer) {
  rbpf_core::ParticleFilter filter(paramsOf(survey));
  filter.observe(observer);
  const double start_s = processorSeconds();
  sail(survey, &filter);
  const double taken_s = processorSeconds() - start_s;
  filter.observe(nullptr);
  return taken_s;
}

// Passes on, and looks at how long who brings odometry or a ping is held up.
class Stopwatch : public rbpf_core::ChangeObserver {
 public:
  explicit Stopwatch(rbpf_core::ChangeObserver* to) : to_(*to) {}
  void onChange(const rbpf_core::Change& change) override {
    const Clock::time_point start = Clock::now();
    to_.onChange(change);
    const bool is_input = std::holds_alternative<rbpf_core::Odometry>(change) ||
                          std::holds_alternative<rbpf_core::Ping>(change);
    const std::chrono::duration<double> taken = Clock::now() - start;
    if (is_input) held_up_s_.push_back(taken.count());
  }
  void settle() override { to_.settle(); }

  double p99_us() {
    std::sort(held_up_s_.begin(), held_up_s_.end());
    return 1e6 * held_up_s_[held_up_s_.size() * 99 / 100];
  }

 private:
  rbpf_core::ChangeObserver& to_;
  std::vector<double> held_up_s_;
};

double megabytesOfCorrections(const std::string& path) {
  rbpf_core::JournalReader journal(path);
  std::size_t bytes = 0;
  while (const auto change = journal.next()) {
    if (!std::holds_alternative<rbpf_core::PastCorrection>(*change)) continue;
    bytes += rbpf_core::journal_format::toRecord(*change).size();
  }
  return static_cast<double>(bytes) / 1e6;
}

double secondsToResume(const std::string& path, const Survey& survey) {
  const Clock::time_point start = Clock::now();
  rbpf_core::ParticleFilter filter(paramsOf(survey));
  rbpf_core::resumeFrom(path, &filter);
  return std::chrono::duration<double>(Clock::now() - start).count();
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 6) {
    std::fprintf(stderr, "usage: bench_journal FILE PARTICLES PINGS_PER_S BEAMS HOURS\n");
    return EXIT_FAILURE;
  }
  const std::string path = argv[1];
  const Survey survey{std::stoul(argv[2]), std::stod(argv[3]), std::stol(argv[4]),
                      std::stod(argv[5])};
  const double without_s = processorSecondsOf(survey, nullptr);
  rbpf_core::JournalWriter writer(path, rbpf_core::JournalWriter::Existing::kOverwrite, nullptr);
  Stopwatch stopwatch(&writer);
  stopwatch.onChange(rbpf_core::settingsOf(paramsOf(survey)));
  const double with_s = processorSecondsOf(survey, &stopwatch);
  writer.settle();
  std::printf(
      "{\"mb\": %.1f, \"mb_of_corrections\": %.1f, \"processor_s_without\": %.2f, "
      "\"processor_s_with\": %.2f, \"held_up_p99_us\": %.1f, \"resume_s\": %.2f, "
      "\"problem\": \"%s\"}\n",
      static_cast<double>(writer.bytes()) / 1e6, megabytesOfCorrections(path), without_s, with_s,
      stopwatch.p99_us(), secondsToResume(path, survey), writer.problem().c_str());
  return EXIT_SUCCESS;
}
