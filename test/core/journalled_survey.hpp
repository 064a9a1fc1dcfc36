// Surveys in which everything happens that can change a filter, and all that a filter shows.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "rbpf_core/journal/filter_settings.hpp"
#include "rbpf_core/journal/journal_writer.hpp"
#include "rbpf_core/journal/resume.hpp"
#include "survey.hpp"

namespace rbpf_core {

class Fingerprint {
 public:
  template <typename T>
  void number(const T& value) {
    static_assert(std::is_arithmetic_v<T> || std::is_enum_v<T>);
    bytes_.append(reinterpret_cast<const char*>(&value), sizeof(T));
  }
  template <typename Matrix>
  void matrix(const Matrix& matrix) {
    for (Eigen::Index i = 0; i < matrix.size(); ++i) number(matrix.data()[i]);
  }
  void pose(const Pose2& pose) {
    number(pose.x_m);
    number(pose.y_m);
    number(pose.yaw_rad);
  }
  void text(const std::string& text) { bytes_ += text; }
  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

inline void look(const SurveyPing& ping, Fingerprint* seen) {
  seen->number(ping.record.stamp_s);
  seen->number(ping.record.attitude.z_m);
  seen->pose(ping.record.dead_reckoning);
  seen->pose(ping.record.online);
  seen->matrix(ping.record.online_covariance);
  seen->number(ping.record.slot);
  seen->number(ping.record.held_out);
  seen->pose(ping.estimate);
  seen->matrix(ping.covariance);
  seen->matrix(ping.levelled_m);
}

inline void lookAtInput(const FilterSnapshot& filter, Fingerprint* seen) {
  seen->number(filter.fixes());
  for (std::size_t i = 0; i < filter.fixes(); ++i) {
    seen->number(filter.fix(i).fix.stamp_s);
    seen->pose(filter.fix(i).dead_reckoning);
  }
  const Counters counters = filter.counters();
  seen->number(counters.odometry_messages);
  seen->number(counters.beams_rejected);
  for (const auto& [what, count] : filter.refused().counts()) {
    seen->text(nameOf(what.first, what.second) + count.example);
    seen->number(count.messages);
  }
  seen->number(filter.odometryUse().gaps());
  seen->number(filter.odometryUse().surveySeconds());
  for (const std::size_t size : {filter.pings(), filter.pingsWaiting(), filter.beams(),
                                 filter.beamsReleased(), filter.beamsHeldOut()}) {
    seen->number(size);
  }
}

// Every number that a filter shows, bit for bit.
inline std::string stateOf(const ParticleFilter& of) {
  const FilterSnapshot filter = of.snapshot();
  Fingerprint seen;
  for (const SurveyPing& ping : filter.survey(0, filter.pings())) look(ping, &seen);
  lookAtInput(filter, &seen);
  for (const Pose2& pose : filter.particles()) seen.pose(pose);
  seen.matrix(filter.logWeights());
  const Estimate estimate = filter.estimate();
  seen.number(estimate.stamp_s);
  seen.pose(estimate.mean);
  seen.matrix(estimate.covariance);
  seen.pose(estimate.dead_reckoning);
  seen.number(filter.past());
  seen.number(filter.bias().surge_mps);
  seen.number(filter.bias().current_y_mps);
  seen.number(filter.redraws());
  std::vector<std::uint32_t> all(of.params().particles);
  for (std::uint32_t j = 0; j < all.size(); ++j) all[j] = j;
  const LogBlock log = filter.logBlock(all, 0, filter.beamsReleased());
  for (std::size_t j = 0; j < all.size(); ++j) {
    for (const PlacedBeam& beam : placed(log, j)) {
      seen.number(beam.x_m);
      seen.number(beam.y_m);
      seen.number(beam.z_m);
    }
  }
  return seen.bytes();
}

inline FilterParams journalledParams() {
  FilterParams params = noisyParams(6, 17);
  params.start_position_std_m = 0.5;
  params.hold_back_s = 3.0;
  params.holdout = 0.1;
  params.ping_queue = 3;
  return params;
}

// One thing after the other happens to a filter, by chance but the same for the same seed.
class ChanceSurvey {
 public:
  explicit ChanceSurvey(unsigned seed) : random_(seed) {}

  void next(ParticleFilter* filter) {
    try {
      happen(filter);
    } catch (const Refusal&) {
      // that is part of it
    }
  }

 private:
  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }
  bool chance(double probability) { return uniform(0.0, 1.0) < probability; }

  void happen(ParticleFilter* filter) {
    const double what = uniform(0.0, 1.0);
    if (what < 0.5) {
      move(filter);
    } else if (what < 0.75) {
      // some from within a gap, from before the odometry that is kept, or from after it
      filter->addPing(pingAt(chance(0.05) ? now_s_ - 20.0 : uniform(now_s_ - 0.5, now_s_ + 0.5),
                             chance(0.1) ? 0 : 5));
    } else if (what < 0.8) {
      addFix(filter);
    } else if (what < 0.85) {
      filter->keepOdometrySince(chance(0.5) ? std::optional<double>(now_s_ - 5.0) : std::nullopt);
    } else {
      decide(filter);
    }
  }

  void move(ParticleFilter* filter) {
    now_s_ += chance(0.02) ? uniform(3.0, 20.0) : 0.2;
    Odometry odometry = turning(chance(0.05) ? now_s_ - 1.0 : now_s_);
    if (chance(0.03)) odometry.pose.x_m = std::numeric_limits<double>::quiet_NaN();
    filter->addOdometry(odometry);
  }

  void addFix(ParticleFilter* filter) {
    const Pose2 mean = filter->snapshot().estimate().mean;
    const double off_m = chance(0.2) ? 1000.0 : uniform(-1.0, 1.0);
    filter->addFix({uniform(now_s_ - 1.0, now_s_ + 0.5),
                    {mean.x_m + off_m, mean.y_m},
                    uniform(0.5, 2.0) * Eigen::Matrix2d::Identity()});
  }

  void decide(ParticleFilter* filter) {
    const auto J = static_cast<Eigen::Index>(filter->params().particles);
    const FilterSnapshot snapshot = filter->snapshot();
    const double what = uniform(0.0, 1.0);
    if (what < 0.4) {
      Eigen::ArrayXd weights(J);
      for (double& weight : weights) weight = uniform(0.1, 1.0);
      filter->setLogWeights((weights / weights.sum()).log());
    } else if (what < 0.6) {
      std::vector<std::uint32_t> ancestors;
      for (Eigen::Index j = 0; j < J; ++j) {
        ancestors.push_back(static_cast<std::uint32_t>(uniform(0.0, 0.999 * double(J))));
      }
      filter->resample(ancestors);
    } else if (what < 0.75) {
      PastCorrection correction;
      for (std::size_t i = 0; i + 2 < snapshot.pings(); i += chance(0.5) ? 1 : 4) {
        correction.of_pings.push_back({i, {uniform(-1, 1), uniform(-1, 1), uniform(-0.01, 0.01)}});
      }
      correction.of_rest = {0.3, -0.2, 0.001};
      correction.bias = {0.01, 0.0, 0.0001, 0.02, -0.01};
      correction.redraws = snapshot.redraws();
      correction.maps_follow = chance(0.5);
      filter->correctPast(correction);
    } else if (what < 0.9) {
      KnownError error{now_s_, snapshot.estimate().mean, 0.1 * Eigen::Matrix3d::Identity()};
      if (chance(0.5)) error.last_fix_s = now_s_ - 10.0;
      filter->setKnownError(error);
    } else {
      const auto fixes = filter->takeFixesToWeigh();
      if (fixes.empty() || chance(0.5)) return;
      Fix given = fixes.back().fix;
      given.heading = Heading{uniform(0.0, 1.0), 0.01};
      filter->drawAnew(given, fixes.back().particles->poses);
    }
  }

  std::mt19937 random_;
  double now_s_ = 100.0;
};

// A folder of its own for journals, as long as it lives.
class JournalFolder {
 public:
  JournalFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "journal.XXXXXX").string();
    folder_ = mkdtemp(name.data());
  }
  ~JournalFolder() { std::filesystem::remove_all(folder_); }
  JournalFolder(const JournalFolder&) = delete;
  JournalFolder& operator=(const JournalFolder&) = delete;

  std::string path(const std::string& name = "survey.journal") const {
    return (folder_ / name).string();
  }

  static std::string bytesOf(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  static void write(const std::string& path, const std::string& bytes) {
    std::ofstream(path, std::ios::binary) << bytes;
  }

 private:
  std::filesystem::path folder_;
};

class JournalTest : public testing::Test, protected JournalFolder {};

}  // namespace rbpf_core
