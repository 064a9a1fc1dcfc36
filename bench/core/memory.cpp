// Resident memory of log, ping records and histories, MB (1e6 bytes), as one line of JSON.
//   bench_memory RESAMPLINGS
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <fstream>

#include "rbpf_core/filter_snapshot.hpp"
#include "synthetic_survey.hpp"

namespace {

double residentMb() {
  std::size_t total = 0;
  std::size_t resident = 0;
  std::ifstream("/proc/self/statm") >> total >> resident;
  return static_cast<double>(resident) * static_cast<double>(sysconf(_SC_PAGESIZE)) / 1e6;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: bench_memory RESAMPLINGS\n");
    return EXIT_FAILURE;
  }
  const double before_mb = residentMb();
  rbpf_core::SurveyLog log;
  rbpf_core::TrajectoryHistories histories(bench::Size{}.particles);
  bench::makeSurvey(
      bench::Size{}, static_cast<std::uint32_t>(std::atoi(argv[1])),
      [&](const auto& poses, const auto& beams) {
        const rbpf_core::PoseSlot slot = histories.append(poses);
        log.pings.push_back({0.0,
                             {},
                             {},
                             {},
                             Eigen::Matrix3d::Zero(),
                             slot,
                             log.training.size(),
                             static_cast<std::uint32_t>(beams.cols()),
                             false});
        log.training.append(slot, beams);
      },
      [&](const auto& ancestors) { histories.resample(ancestors); });
  std::printf("{\"resident_mb\": %.1f, \"beams\": %zu, \"pings\": %zu, \"stored_poses\": %zu}\n",
              residentMb() - before_mb, log.training.size(), log.pings.size(),
              histories.storedPoses());
  return EXIT_SUCCESS;
}
