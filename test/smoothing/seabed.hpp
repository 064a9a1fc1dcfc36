// Seabeds that are known everywhere, and beams on them. Seeds are fixed, so that a test that passes
// once always passes.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "rbpf_core/rigid.hpp"
#include "rbpf_core/types.hpp"

namespace rbpf_core::smoothing {

// A plane with waves on it, whose heights grow with their lengths: all slopes are alike.
class Seabed {
 public:
  static constexpr double kLevel_m = -80.0;

  static Seabed flat() { return Seabed(); }

  static Seabed slope(double slope_x, double slope_y) {
    Seabed seabed;
    seabed.slope_ = {slope_x, slope_y};
    return seabed;
  }

  // One wave, which repeats itself along x.
  static Seabed ripples(double length_m, double height_m) {
    Seabed seabed;
    seabed.waves_.push_back({Eigen::Vector2d(2.0 * M_PI / length_m, 0.0), 0.3, height_m});
    return seabed;
  }

  // Waves of 12 to 70 m, in all directions; std_m: of the depths about their mean.
  static Seabed relief(double std_m, std::uint32_t seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> uniform;
    Seabed seabed;
    double power = 0.0;
    for (int wave = 0; wave < 20; ++wave) {
      const double length_m = 12.0 * std::pow(70.0 / 12.0, uniform(random));
      const double direction = 2.0 * M_PI * uniform(random);
      const Eigen::Vector2d number =
          2.0 * M_PI / length_m * Eigen::Vector2d(std::cos(direction), std::sin(direction));
      seabed.waves_.push_back({number, 2.0 * M_PI * uniform(random), length_m});
      power += 0.5 * length_m * length_m;
    }
    for (Wave& wave : seabed.waves_) wave.height_m *= std_m / std::sqrt(power);
    return seabed;
  }

  // Waves along x only, of many lengths: they do not repeat themselves.
  static Seabed ridges(double std_m, std::uint32_t seed) {
    Seabed seabed = relief(std_m, seed);
    for (Wave& wave : seabed.waves_) wave.number = {wave.number.norm(), 0.0};
    return seabed;
  }

  double z_m(double x_m, double y_m) const {
    const Eigen::Vector2d at(x_m, y_m);
    double z = kLevel_m + slope_.dot(at);
    for (const Wave& wave : waves_) z += wave.height_m * std::sin(wave.number.dot(at) + wave.phase);
    return z;
  }

  Eigen::Vector2d slopeAt(double x_m, double y_m) const {
    Eigen::Vector2d slope = slope_;
    for (const Wave& wave : waves_) {
      slope += wave.height_m * std::cos(wave.number.dot(Eigen::Vector2d(x_m, y_m)) + wave.phase) *
               wave.number;
    }
    return slope;
  }

 private:
  struct Wave {
    Eigen::Vector2d number;  // rad/m
    double phase;
    double height_m;
  };

  Seabed() = default;

  Eigen::Vector2d slope_ = Eigen::Vector2d::Zero();
  std::vector<Wave> waves_;
};

// How beams hit it. Outliers lie up to 5 m off, evenly.
struct Sounding {
  double noise_std_m = 0.1;
  double outliers = 0.0;  // share
};

// In place of beams' z, which are at x, y in the frame of a pose.
inline void sound(const Seabed& seabed, const Pose2& pose, const Sounding& sounding,
                  std::mt19937* random, Beams* beams_m) {
  std::normal_distribution<double> normal(0.0, sounding.noise_std_m);
  std::uniform_real_distribution<double> uniform;
  for (Eigen::Index b = 0; b < beams_m->cols(); ++b) {
    const Pose2 at = compose(pose, {(*beams_m)(0, b), (*beams_m)(1, b), 0.0});
    double z = seabed.z_m(at.x_m, at.y_m) + normal(*random);
    if (uniform(*random) < sounding.outliers) z += 10.0 * (uniform(*random) - 0.5);
    (*beams_m)(2, b) = static_cast<float>(z);
  }
}

// Evenly over a rectangle about a pose, in its frame.
inline Beams beamsAbout(const Seabed& seabed, const Pose2& pose, double length_m, double width_m,
                        Eigen::Index beams, std::uint32_t seed, const Sounding& sounding = {}) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(-0.5, 0.5);
  Beams out(3, beams);
  for (Eigen::Index b = 0; b < beams; ++b) {
    out(0, b) = static_cast<float>(length_m * uniform(random));
    out(1, b) = static_cast<float>(width_m * uniform(random));
  }
  sound(seabed, pose, sounding, &random, &out);
  return out;
}

}  // namespace rbpf_core::smoothing
