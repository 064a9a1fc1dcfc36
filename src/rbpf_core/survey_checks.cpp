#include "rbpf_core/survey_checks.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "rbpf_core/decimal.hpp"

namespace rbpf_core {

namespace {

constexpr std::size_t kPingsTogether = 20;
constexpr std::uint64_t kPingsBeforeWarning = 200;
// Local coordinates begin near their origin, projected ones do not.
constexpr double kFarApart_m = 10000.0;

std::string metres(double value_m) { return decimal(value_m, 1) + " m"; }

std::string countOf(double beams) { return decimal(beams, 0); }

}  // namespace

// ---- beams ---------------------------------------------------------------------------------

void BeamGeometry::Sums::add(const Sums& others, double sign) {
  beams += sign * others.beams;
  above_vehicle += sign * others.above_vehicle;
  above_sea += sign * others.above_sea;
  z_m += sign * others.z_m;
  vehicle_z_m += sign * others.vehicle_z_m;
}

void BeamGeometry::add(const Attitude& attitude, const Beams& levelled_m) {
  const Eigen::ArrayXd z_m = levelled_m.row(2).transpose().cast<double>();
  const auto n = static_cast<double>(z_m.size());
  pings_.push_back({n, static_cast<double>((z_m > attitude.z_m).count()),
                    static_cast<double>((z_m > 0.0).count()), z_m.sum(), n * attitude.z_m});
  together_.add(pings_.back(), 1.0);
  if (pings_.size() > kPingsTogether) {
    together_.add(pings_.front(), -1.0);
    pings_.pop_front();
  }
  if (pings_.size() < kPingsTogether) return;
  if (!beams_above_vehicle_ && together_.above_vehicle > 0.5 * together_.beams) {
    beams_above_vehicle_ = beamsAboveVehicle();
  }
  if (!seabed_above_sea_ && together_.above_sea > 0.5 * together_.beams) {
    seabed_above_sea_ = seabedAboveSea();
  }
}

Finding BeamGeometry::beamsAboveVehicle() const {
  const double vehicle_z_m = together_.vehicle_z_m / together_.beams;
  const double z_m = together_.z_m / together_.beams;
  const std::string cause =
      vehicle_z_m > 0.0 && z_m > 0.0
          ? "z_down: z points down in the odometry and the pings alike, expected up; turned round, "
            "the seabed lies at z = " +
                metres(-z_m) + " and the vehicle at z = " + metres(-vehicle_z_m)
          : "z_down: z points down in the pings, expected up, or the mount is upside down; turned "
            "round, the seabed lies at z = " +
                metres(2.0 * vehicle_z_m - z_m);
  return {"beams_above_vehicle", Severity::kError,
          countOf(together_.above_vehicle) + " of the " + countOf(together_.beams) + " beams of " +
              std::to_string(kPingsTogether) +
              " pings lie above the vehicle, at z = " + metres(z_m) +
              " (mean), the vehicle at z = " + metres(vehicle_z_m) + ". Likely cause: " + cause};
}

Finding BeamGeometry::seabedAboveSea() const {
  const double vehicle_z_m = together_.vehicle_z_m / together_.beams;
  const double z_m = together_.z_m / together_.beams;
  std::string cause;
  if (together_.above_vehicle > 0.5 * together_.beams) {
    cause = "z_down, as for beams_above_vehicle";
  } else if (vehicle_z_m > 0.0) {
    cause =
        "the odometry's z is a depth, positive down, expected negative under water (turned round, "
        "the seabed lies at z = " +
        metres(z_m - 2.0 * vehicle_z_m) + "), or a height above something other than the sea";
  } else {
    cause = "z_down: z points down in the pings, expected up, or the mount is upside down";
  }
  return {"seabed_above_sea", Severity::kWarning,
          countOf(together_.above_sea) + " of the " + countOf(together_.beams) + " beams of " +
              std::to_string(kPingsTogether) +
              " pings lie above the sea surface, z = 0: at z = " + metres(z_m) +
              " (mean), the vehicle at z = " + metres(vehicle_z_m) + ". Likely cause: " + cause};
}

std::vector<Finding> BeamGeometry::findings() const {
  std::vector<Finding> findings;
  if (beams_above_vehicle_) findings.push_back(*beams_above_vehicle_);
  if (seabed_above_sea_) findings.push_back(*seabed_above_sea_);
  return findings;
}

// ---- the survey area -----------------------------------------------------------------------

void AreaCoverage::Box::add(const Eigen::Vector2d& point_m) {
  low_m = low_m.cwiseMin(point_m);
  high_m = high_m.cwiseMax(point_m);
}

AreaCoverage::AreaCoverage(std::vector<Eigen::Vector2d> area_m) : area_m_(std::move(area_m)) {
  for (const Eigen::Vector2d& corner_m : area_m_) area_box_.add(corner_m);
}

void AreaCoverage::add(const Pose2& pose, const Beams& levelled_m) {
  if (area_m_.empty()) return;
  ++pings_;
  beams_ += static_cast<std::uint64_t>(levelled_m.cols());
  const double c = std::cos(pose.yaw_rad);
  const double s = std::sin(pose.yaw_rad);
  for (Eigen::Index i = 0; i < levelled_m.cols(); ++i) {
    const Eigen::Vector2d b_m = levelled_m.col(i).head<2>().cast<double>();
    const Eigen::Vector2d point_m(pose.x_m + c * b_m.x() - s * b_m.y(),
                                  pose.y_m + s * b_m.x() + c * b_m.y());
    beams_box_.add(point_m);
    if (contains(point_m)) ++beams_inside_;
  }
}

bool AreaCoverage::contains(const Eigen::Vector2d& point_m) const {
  // inside if a ray along x crosses the outline an odd number of times
  bool inside = false;
  for (std::size_t i = 0; i < area_m_.size(); ++i) {
    const Eigen::Vector2d& a = area_m_[i];
    const Eigen::Vector2d& b = area_m_[(i + 1) % area_m_.size()];
    if ((a.y() > point_m.y()) == (b.y() > point_m.y())) continue;
    const double crossing_x_m = a.x() + (point_m.y() - a.y()) / (b.y() - a.y()) * (b.x() - a.x());
    if (point_m.x() < crossing_x_m) inside = !inside;
  }
  return inside;
}

double AreaCoverage::share() const {
  if (beams_ == 0) return std::numeric_limits<double>::quiet_NaN();
  return static_cast<double>(beams_inside_) / static_cast<double>(beams_);
}

std::string AreaCoverage::nameOf(const Box& box) {
  return "x " + decimal(box.low_m.x(), 0) + " to " + decimal(box.high_m.x(), 0) + " m, y " +
         decimal(box.low_m.y(), 0) + " to " + decimal(box.high_m.y(), 0) + " m";
}

std::optional<Finding> AreaCoverage::finding() const {
  if (beams_ == 0 || beams_inside_ > 0) return std::nullopt;
  if (!finished_ && pings_ < kPingsBeforeWarning) return std::nullopt;
  const Eigen::Vector2d between_m =
      (beams_box_.low_m - area_box_.high_m).cwiseMax(area_box_.low_m - beams_box_.high_m);
  const double apart_m = between_m.cwiseMax(0.0).norm();
  const std::string cause =
      apart_m > kFarApart_m
          ? "one is in UTM, the other in local coordinates: they lie " +
                decimal(apart_m / 1000.0, 0) + " km apart"
          : "survey_area is not in map, as [[x, y], ...] in metres, or the start is another than "
            "planned: they lie " +
                decimal(apart_m, 0) + " m apart";
  return Finding{"area_missed", finished_ ? Severity::kError : Severity::kWarning,
                 "none of the beams of " + std::to_string(pings_) +
                     " pings lies in survey_area, of which alone maps are made: beams " +
                     nameOf(beams_box_) + "; survey_area " + nameOf(area_box_) +
                     ". Likely cause: " + cause};
}

// ---- all of them ---------------------------------------------------------------------------

void SurveyChecks::add(const SurveyPing& ping) {
  beam_geometry_.add(ping.record.attitude, ping.levelled_m);
  area_coverage_.add(ping.estimate, ping.levelled_m);
}

std::vector<Finding> SurveyChecks::findings() const {
  std::vector<Finding> findings = beam_geometry_.findings();
  if (const auto& twist = twist_against_pose_.finding()) findings.push_back(*twist);
  if (const auto area = area_coverage_.finding()) findings.push_back(*area);
  return findings;
}

}  // namespace rbpf_core
