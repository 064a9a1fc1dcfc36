// Checks of the survey as a whole, fed with what the filter has taken in. What is found stays
// found. None of them throws, and none changes anything. To be called from one thread at a time.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <deque>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "rbpf_core/filter_snapshot.hpp"
#include "rbpf_core/finding.hpp"
#include "rbpf_core/twist_against_pose.hpp"

namespace rbpf_core {

// Whether beams lie below the vehicle and the seabed below the sea: over twenty pings together,
// since single beams lie anywhere.
class BeamGeometry {
 public:
  // Beams as the log has them: their z is that in map.
  void add(const Attitude& attitude, const Beams& levelled_m);
  // beams_above_vehicle, seabed_above_sea
  std::vector<Finding> findings() const;

 private:
  // Counts and sums over beams.
  struct Sums {
    double beams = 0.0;
    double above_vehicle = 0.0;
    double above_sea = 0.0;
    double z_m = 0.0;
    double vehicle_z_m = 0.0;

    void add(const Sums& others, double sign);
  };

  Finding beamsAboveVehicle() const;
  Finding seabedAboveSea() const;

  std::deque<Sums> pings_;
  Sums together_;
  std::optional<Finding> beams_above_vehicle_;
  std::optional<Finding> seabed_above_sea_;
};

// Whether any beams fall into the survey area: maps reach no further.
class AreaCoverage {
 public:
  // A polygon in map, closed or not; an empty one is not checked.
  explicit AreaCoverage(std::vector<Eigen::Vector2d> area_m);

  // A ping where it was seen.
  void add(const Pose2& pose, const Beams& levelled_m);
  // No more pings will come.
  void finish() { finished_ = true; }

  // area_missed: a warning after the first 200 pings, an error at the end; nothing as soon as a
  // beam has fallen into the area.
  std::optional<Finding> finding() const;
  // Of all beams, those that lie in the area; NaN before the first.
  double share() const;

 private:
  struct Box {
    Eigen::Vector2d low_m = Eigen::Vector2d::Constant(std::numeric_limits<double>::infinity());
    Eigen::Vector2d high_m = -low_m;

    void add(const Eigen::Vector2d& point_m);
  };

  static std::string nameOf(const Box& box);
  bool contains(const Eigen::Vector2d& point_m) const;

  const std::vector<Eigen::Vector2d> area_m_;
  Box area_box_;
  Box beams_box_;
  std::uint64_t pings_ = 0;
  std::uint64_t beams_ = 0;
  std::uint64_t beams_inside_ = 0;
  bool finished_ = false;
};

// All of them.
class SurveyChecks {
 public:
  SurveyChecks(Velocity velocity, std::vector<Eigen::Vector2d> area_m)
      : twist_against_pose_(velocity), area_coverage_(std::move(area_m)) {}

  void add(const Odometry& odometry) { twist_against_pose_.add(odometry); }
  void add(const SurveyPing& ping);
  void finish() { area_coverage_.finish(); }

  std::vector<Finding> findings() const;
  const AreaCoverage& areaCoverage() const { return area_coverage_; }

 private:
  TwistAgainstPose twist_against_pose_;
  BeamGeometry beam_geometry_;
  AreaCoverage area_coverage_;
};

}  // namespace rbpf_core
