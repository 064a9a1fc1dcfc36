// A small survey, and its dead reckoning. Seeds are fixed.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "rbpf_core/rigid.hpp"
#include "rbpf_core/smoothing/smoothing_params.hpp"
#include "seabed.hpp"

namespace rbpf_core::smoothing {

constexpr double kPing_s = 0.4;
constexpr double kSpeed_mps = 2.0;
constexpr double kHalfWidth_m = 18.0;
constexpr Eigen::Index kBeams = 80;

struct Survey {
  SmoothingParams params;
  std::vector<double> stamps_s;
  std::vector<Pose2> truth, dead_reckoning;
  std::vector<Beams> beams_m;

  std::size_t size() const { return stamps_s.size(); }
};

struct Line {
  Eigen::Vector2d from, to;
};

// Four of 120 m, 20 m apart, and two across them.
inline const std::vector<Line> kCrossed{{{0, 0}, {120, 0}},    {{120, 20}, {0, 20}},
                                        {{0, 40}, {120, 40}},  {{120, 60}, {0, 60}},
                                        {{30, 80}, {30, -20}}, {{85, -20}, {85, 80}}};

// One line after the other, steered at a point 12 m ahead on it.
inline std::vector<Pose2> sailed(const std::vector<Line>& lines) {
  std::vector<Pose2> poses;
  Pose2 pose{-10.0, 0.0, 0.0};
  for (const Line& line : lines) {
    const Eigen::Vector2d along = (line.to - line.from).normalized();
    const double length_m = (line.to - line.from).norm();
    double reached_m = 0.0;
    while (reached_m < length_m) {
      reached_m = along.dot(Eigen::Vector2d(pose.x_m, pose.y_m) - line.from);
      const Eigen::Vector2d aim = line.from + (std::max(reached_m, -10.0) + 12.0) * along;
      const double heading = std::atan2(aim.y() - pose.y_m, aim.x() - pose.x_m);
      const double turn =
          std::clamp(wrapAngle(heading - pose.yaw_rad), -0.25 * kPing_s, 0.25 * kPing_s);
      pose = compose(pose, {kSpeed_mps * kPing_s, 0.0, turn});
      poses.push_back(pose);
    }
  }
  return poses;
}

inline Survey surveyOf(const Seabed& seabed, std::uint32_t seed, const MotionNoise& motion = {},
                       const Sounding& sounding = {0.1, 0.02},
                       const std::vector<Line>& lines = kCrossed) {
  Survey survey;
  SmoothingParams& params = survey.params;
  params.motion = motion;
  params.velocity_bias_std_mps = 0.03;
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  const Eigen::Vector3d bias(params.velocity_bias_std_mps * normal(random),
                             params.velocity_bias_std_mps * normal(random),
                             params.yaw_bias_std_radps * normal(random));
  survey.truth = sailed(lines);
  Pose2 dead_reckoning = survey.truth.front();
  const double root_s = std::sqrt(kPing_s);
  for (std::size_t i = 0; i < survey.truth.size(); ++i) {
    if (i > 0) {
      Pose2 moved = relative(survey.truth[i - 1], survey.truth[i]);
      moved.x_m += bias(0) * kPing_s + params.motion.surge_std_m * root_s * normal(random);
      moved.y_m += bias(1) * kPing_s + params.motion.sway_std_m * root_s * normal(random);
      moved.yaw_rad += bias(2) * kPing_s + params.motion.yaw_std_rad * root_s * normal(random);
      dead_reckoning = compose(dead_reckoning, moved);
    }
    survey.stamps_s.push_back(50.0 + kPing_s * static_cast<double>(i));
    survey.dead_reckoning.push_back(dead_reckoning);
    Beams ping(3, kBeams);
    ping.row(0).setZero();
    ping.row(1).setLinSpaced(kBeams, -static_cast<float>(kHalfWidth_m),
                             static_cast<float>(kHalfWidth_m));
    sound(seabed, survey.truth[i], sounding, &random, &ping);
    survey.beams_m.push_back(ping);
  }
  return survey;
}

}  // namespace rbpf_core::smoothing
