// The noise of the motion model against closed-form moments.
#include <gtest/gtest.h>

#include <cmath>
#include <complex>

#include "rbpf_core/motion_model.hpp"
#include "statistics.hpp"

namespace rbpf_core {
namespace {

using Complex = std::complex<double>;

struct Leg {
  double speed_mps, yaw_rate_radps;
  double duration_s, rate_hz;
  MotionNoise noise;

  int steps() const { return static_cast<int>(std::lround(duration_s * rate_hz)); }
  double step_s() const { return 1.0 / rate_hz; }
};

// [n, 3]: x, y and yaw (not wrapped) of n particles that start at the origin, after the leg.
Eigen::MatrixXd sampleEnds(const Leg& leg, Eigen::Index particles) {
  const MotionIncrement motion{leg.step_s(), leg.speed_mps * leg.step_s(), 0.0,
                               leg.yaw_rate_radps * leg.step_s()};
  Eigen::MatrixXd ends(particles, 3);
  for (Eigen::Index j = 0; j < particles; ++j) {
    RandomStream stream = makeStream(1, StreamPurpose::kMotion, static_cast<std::uint64_t>(j));
    Pose2 pose;
    double yaw = 0.0;
    for (int k = 0; k < leg.steps(); ++k) {
      const double before = pose.yaw_rad;
      pose = advanceNoisily(pose, motion, leg.noise, stream);
      yaw += wrapAngle(pose.yaw_rad - before);
    }
    ends.row(j) << pose.x_m, pose.y_m, yaw;
  }
  return ends;
}

// Exact moments of x + i y = sum_k exp(i phi_k) (f_k + i l_k), where the halfway headings phi_k are
// sums of the independent yaw steps delta ~ N(omega dt, s^2): phi_k = sum_{i<k} delta_i +
// delta_k/2, and E exp(i a) = exp(i E a - var(a) / 2) for Gaussian a.
Moments exactMoments(const Leg& leg) {
  const double dt = leg.step_s();
  const double yaw_variance = leg.noise.yaw_std_rad * leg.noise.yaw_std_rad * dt;
  const double surge_variance = leg.noise.surge_std_m * leg.noise.surge_std_m * dt;
  const double sway_variance = leg.noise.sway_std_m * leg.noise.sway_std_m * dt;
  const double forward = leg.speed_mps * dt;
  const double turn = leg.yaw_rate_radps * dt;
  const Complex i(0.0, 1.0);
  const int n = leg.steps();

  Complex mean, square, yaw_product;  // E p, E p^2, E p (yaw - E yaw)
  double modulus = 0.0;               // E |p|^2
  for (int k = 0; k < n; ++k) {
    const Complex direction = std::exp(i * turn * (k + 0.5) - 0.5 * yaw_variance * (k + 0.25));
    mean += forward * direction;
    yaw_product += forward * direction * i * yaw_variance * (k + 0.5);
    modulus += forward * forward + surge_variance + sway_variance;
    square += std::exp(2.0 * i * turn * (k + 0.5) - 2.0 * yaw_variance * (k + 0.25)) *
              (forward * forward + surge_variance - sway_variance);
    for (int j = 0; j < k; ++j) {
      // var(phi_k - phi_j) = s^2 (k - j - 1/2), var(phi_k + phi_j) = s^2 (k + 3 j + 3/2)
      modulus += 2.0 * forward * forward * std::cos(turn * (k - j)) *
                 std::exp(-0.5 * yaw_variance * (k - j - 0.5));
      square += 2.0 * forward * forward *
                std::exp(i * turn * (k + j + 1.0) - 0.5 * yaw_variance * (k + 3.0 * j + 1.5));
    }
  }
  Moments moments{Eigen::RowVector3d(mean.real(), mean.imag(), turn * n), Eigen::Matrix3d::Zero()};
  const double xx = 0.5 * (modulus + square.real()) - mean.real() * mean.real();
  const double yy = 0.5 * (modulus - square.real()) - mean.imag() * mean.imag();
  const double xy = 0.5 * square.imag() - mean.real() * mean.imag();
  moments.covariance << xx, xy, yaw_product.real(),  //
      xy, yy, yaw_product.imag(),                    //
      yaw_product.real(), yaw_product.imag(), yaw_variance * n;
  return moments;
}

void expectMoments(const Eigen::MatrixXd& samples, const Moments& expected) {
  const Moments seen = momentsOf(samples);
  const Eigen::Index n = samples.rows();
  for (Eigen::Index a = 0; a < 3; ++a) {
    const double mean_error = std::sqrt(expected.covariance(a, a) / static_cast<double>(n));
    EXPECT_NEAR(seen.mean(a), expected.mean(a), kStandardErrors * mean_error) << "of " << a;
    for (Eigen::Index b = 0; b <= a; ++b) {
      EXPECT_NEAR(seen.covariance(a, b), expected.covariance(a, b),
                  kStandardErrors * covarianceError(expected.covariance, a, b, n))
          << "of " << a << " and " << b;
    }
  }
}

// The limit of short steps and small yaw noise, a straight line along x:
//   var x = s^2 T,  var y = w^2 T + v^2 q^2 T^3 / 3,  cov(y, yaw) = v q^2 T^2 / 2,  var yaw = q^2 T
Moments straightLineMoments(const Leg& leg) {
  const double T = leg.duration_s;
  const double v = leg.speed_mps;
  const double s2 = leg.noise.surge_std_m * leg.noise.surge_std_m;
  const double w2 = leg.noise.sway_std_m * leg.noise.sway_std_m;
  const double q2 = leg.noise.yaw_std_rad * leg.noise.yaw_std_rad;
  Moments moments{Eigen::RowVector3d(v * T, 0.0, 0.0), Eigen::Matrix3d::Zero()};
  moments.covariance(0, 0) = s2 * T;
  moments.covariance(1, 1) = w2 * T + v * v * q2 * T * T * T / 3.0;
  moments.covariance(2, 2) = q2 * T;
  moments.covariance(1, 2) = moments.covariance(2, 1) = v * q2 * T * T / 2.0;
  return moments;
}

constexpr Eigen::Index kNoisyParticles = 4000;

// Noise is given per second: whatever the odometry's rate, the spread after a time is the same.
TEST(MotionNoise, SpreadsAStraightLineAlikeAt5And20And100Hz) {
  for (const double rate_hz : {5.0, 20.0, 100.0}) {
    SCOPED_TRACE(rate_hz);
    const Leg leg{2.0, 0.0, 10.0, rate_hz, {0.2, 0.1, 0.01}};
    expectMoments(sampleEnds(leg, kNoisyParticles), straightLineMoments(leg));
  }
}

// Turning, with so much yaw noise that small angles no longer do.
TEST(MotionNoise, HasTheExactMomentsOfANoisyTurn) {
  for (const double rate_hz : {2.0, 20.0}) {
    SCOPED_TRACE(rate_hz);
    const Leg leg{1.5, 0.2, 10.0, rate_hz, {0.3, 0.1, 0.2}};
    expectMoments(sampleEnds(leg, kNoisyParticles), exactMoments(leg));
  }
}

TEST(MotionNoise, GrowsWithTheTimeSinceTheLastMessage) {
  Leg leg{0.0, 0.0, 8.0, 0.125, {0.2, 0.1, 0.01}};  // one message, after a gap of 8 s
  expectMoments(sampleEnds(leg, kNoisyParticles), straightLineMoments(leg));
}

TEST(MotionNoise, LiesAlongTheVehicleNotAlongTheMap) {
  const MotionNoise surge_only{1.0, 0.0, 0.0};
  const MotionNoise sway_only{0.0, 1.0, 0.0};
  const Pose2 heading_north{0.0, 0.0, M_PI / 2.0};
  RandomStream stream(1);
  for (int i = 0; i < 100; ++i) {
    // 1e-15: the rounding of cos(pi / 2) times a few metres
    EXPECT_NEAR(advanceNoisily(heading_north, {1.0, 0.0, 0.0, 0.0}, surge_only, stream).x_m, 0.0,
                1e-15);
    EXPECT_NEAR(advanceNoisily(heading_north, {1.0, 0.0, 0.0, 0.0}, sway_only, stream).y_m, 0.0,
                1e-15);
  }
}

TEST(MotionNoise, OfZeroIsDeadReckoning) {
  RandomStream stream(1);
  const Pose2 start{3.0, 4.0, 1.0};
  const MotionIncrement motion{0.1, 0.2, -0.05, 0.03};
  const Pose2 noisy = advanceNoisily(start, motion, {0.0, 0.0, 0.0}, stream);
  const Pose2 exact = advance(start, motion);
  EXPECT_EQ(noisy.x_m, exact.x_m);
  EXPECT_EQ(noisy.y_m, exact.y_m);
  EXPECT_EQ(noisy.yaw_rad, exact.yaw_rad);
}

TEST(MotionNoise, IsTheSameForTheSameStream) {
  RandomStream a(5);
  RandomStream b(5);
  const MotionIncrement motion{0.1, 0.2, 0.0, 0.0};
  for (int i = 0; i < 10; ++i) {
    EXPECT_EQ(advanceNoisily({}, motion, {}, a).x_m, advanceNoisily({}, motion, {}, b).x_m);
  }
}

}  // namespace
}  // namespace rbpf_core
