// Beams per second placed into minibatches of 1,000, over the resamplings that there have been:
// pointer segments against the ancestry tree, on the same survey of 12.4 million beams.
#include <benchmark/benchmark.h>

#include <map>
#include <memory>
#include <vector>

#include "ancestry_tree.hpp"
#include "rbpf_core/minibatch.hpp"
#include "synthetic_survey.hpp"

namespace {

using namespace rbpf_core;

constexpr std::size_t kMinibatch = 1000;  // M

struct Segments {
  explicit Segments(std::uint32_t resamplings) : histories(bench::Size{}.particles) {
    bench::makeSurvey(
        bench::Size{}, resamplings,
        [&](const auto& poses, const auto& beams) { log.append(histories.append(poses), beams); },
        [&](const auto& ancestors) { histories.resample(ancestors); });
  }

  void draw(std::size_t particle, RandomStream stream, PlacedBeam* out) const {
    drawMinibatch(log, log.size(), *histories.trajectories(), particle, {}, stream, kMinibatch,
                  out);
  }

  TrajectoryHistories histories;
  MbesLog log;
};

struct Tree {
  explicit Tree(std::uint32_t resamplings) : histories(bench::Size{}.particles) {
    std::uint32_t ping = 0;  // stands in the log in place of a slot
    bench::makeSurvey(
        bench::Size{}, resamplings,
        [&](const auto& poses, const auto& beams) {
          histories.append(poses);
          log.append(ping++, beams);
        },
        [&](const auto& ancestors) { histories.resample(ancestors); });
  }

  void draw(std::size_t particle, RandomStream stream, PlacedBeam* out) const {
    for (std::size_t i = 0; i < kMinibatch; ++i) {
      const LoggedBeam& beam = log[stream.below(log.size())];
      out[i] = place(beam, histories.at(particle, beam.slot), {});
    }
  }

  bench::AncestryTree histories;
  MbesLog log;
};

template <typename Histories>
void placeMinibatches(benchmark::State& state) {
  static std::unique_ptr<Histories> survey;  // one at a time: 0.3 GB
  static std::int64_t made_for = -1;
  if (made_for != state.range(0)) {
    survey.reset();
    survey = std::make_unique<Histories>(static_cast<std::uint32_t>(state.range(0)));
    made_for = state.range(0);
  }
  std::vector<PlacedBeam> minibatch(kMinibatch);
  std::uint64_t call = 0;
  for (auto _ : state) {  // one minibatch for each particle in turn, as map nodes ask for them
    survey->draw(call % bench::Size{}.particles, RandomStream(RandomStream::mix(call)),
                 minibatch.data());
    ++call;
    benchmark::DoNotOptimize(minibatch.data());
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(static_cast<std::int64_t>(call * kMinibatch));
}

void overResamplings(benchmark::internal::Benchmark* benchmark) {
  for (const int resamplings : {1, 10, 100, 1000}) benchmark->Arg(resamplings);
}

BENCHMARK(placeMinibatches<Segments>)->Name("segments")->Apply(overResamplings);
BENCHMARK(placeMinibatches<Tree>)->Name("ancestry_tree")->Apply(overResamplings);

}  // namespace

BENCHMARK_MAIN();
