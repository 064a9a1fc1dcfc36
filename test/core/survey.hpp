// A small survey that the tests of the filter share: a vehicle over flat seabed, in a few lines.
#pragma once

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <string>
#include <vector>

#include "placed_block.hpp"
#include "rbpf_core/particle_filter.hpp"

namespace rbpf_core {

// J particles that all follow the odometry exactly; every ping is kept whole and can be drawn at
// once.
inline FilterParams quietParams(std::size_t particles = 3) {
  FilterParams params;
  params.particles = particles;
  params.motion = {0.0, 0.0, 0.0};
  params.pings.outlier_window = 0;
  params.hold_back_s = 0.0;
  params.holdout = 0.0;
  return params;
}

inline FilterParams noisyParams(std::size_t particles = 5, std::uint64_t seed = 1) {
  FilterParams params = quietParams(particles);
  params.motion = {0.3, 0.2, 0.05};
  params.seed = seed;
  return params;
}

// 2 m/s ahead and 0.1 rad/s to the left, from (5, 6, 0.3): a circle.
inline Odometry turning(double stamp_s) {
  Odometry odometry;
  odometry.stamp_s = stamp_s;
  odometry.pose = {5.0, 6.0, 0.3};
  odometry.attitude.z_m = -10.0;
  odometry.linear_mps = {2.0, 0.0, 0.0};
  odometry.angular_radps = {0.0, 0.0, 0.1};
  return odometry;
}

// 2 m/s along x from the origin.
inline Odometry straight(double stamp_s) {
  Odometry odometry = turning(stamp_s);
  odometry.pose = {2.0 * stamp_s, 0.0, 0.0};
  odometry.angular_radps.setZero();
  return odometry;
}

// Beams across the track, 20 m below the vehicle; x carries `mark`, in metres ahead.
inline Ping pingAt(double stamp_s, Eigen::Index beams = 8, float mark = 0.0F) {
  Ping ping;
  ping.stamp_s = stamp_s;
  ping.beams_m.resize(3, beams);
  for (Eigen::Index i = 0; i < beams; ++i) {
    ping.beams_m.col(i) << mark, static_cast<float>(i), -20.0F;
  }
  return ping;
}

// Odometry at 5 Hz and a ping every 0.7 s, over [from, to).
template <typename OdometryAt>
void sail(ParticleFilter& filter, const OdometryAt& odometry_at, int from_s, int to_s) {
  for (int k = 5 * from_s; k < 5 * to_s; ++k) {
    filter.addOdometry(odometry_at(0.2 * k));
    if (k % 7 == 3) filter.addPing(pingAt(0.1 * (2 * k - 1), 8 + k % 5));
  }
}

// Why the filter refuses a ping; an empty string if it does not.
inline std::string problemWith(ParticleFilter& filter, const Ping& ping) {
  try {
    filter.addPing(ping);
  } catch (const Refusal& refused) {
    return refused.what();
  }
  return "";
}

inline bool operator==(const Pose2& a, const Pose2& b) {
  return a.x_m == b.x_m && a.y_m == b.y_m && a.yaw_rad == b.yaw_rad;
}

inline bool operator==(const PlacedBeam& a, const PlacedBeam& b) {
  return a.x_m == b.x_m && a.y_m == b.y_m && a.z_m == b.z_m;
}

inline void expectNear(const Pose2& seen, const Pose2& expected, double tolerance) {
  EXPECT_NEAR(seen.x_m, expected.x_m, tolerance);
  EXPECT_NEAR(seen.y_m, expected.y_m, tolerance);
  EXPECT_NEAR(wrapAngle(seen.yaw_rad - expected.yaw_rad), 0.0, tolerance);
}

inline std::vector<PlacedBeam> drawFrom(const ParticleFilter& filter, std::size_t particle,
                                        std::size_t size) {
  std::vector<PlacedBeam> batch(size);
  filter.snapshot().drawMinibatch(particle, size, batch.data());
  return batch;
}

inline std::vector<PlacedBeam> blockFrom(const ParticleFilter& filter, std::size_t particle,
                                         std::size_t first, std::size_t size) {
  return placed(filter.snapshot().logBlock({static_cast<std::uint32_t>(particle)}, first, size));
}

}  // namespace rbpf_core
