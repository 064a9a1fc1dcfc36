// Beams against the vehicle and the sea, and against the survey area.
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "rbpf_core/survey_checks.hpp"
#include "survey.hpp"

namespace rbpf_core {
namespace {

bool says(const Finding& finding, const std::string& text) {
  return finding.text.find(text) != std::string::npos;
}

// ---- beams -------------------------------------------------------------------------------------

// Pings of ten beams about a depth, the sensor's frame as a mount may turn it.
Beams seabedAt(double z_m, Eigen::Index beams = 10) {
  Beams levelled(3, beams);
  for (Eigen::Index i = 0; i < beams; ++i) {
    levelled.col(i) << 0.0F, static_cast<float>(i), static_cast<float>(z_m + 0.1 * (i % 3));
  }
  return levelled;
}

std::vector<Finding> findingsOf(double vehicle_z_m, double seabed_z_m, int pings = 60) {
  BeamGeometry check;
  for (int k = 0; k < pings; ++k) check.add({vehicle_z_m, 0.0, 0.0}, seabedAt(seabed_z_m));
  return check.findings();
}

TEST(BeamGeometry, PassesASeabedBelowTheVehicle) {
  for (const auto& [vehicle_z_m, seabed_z_m] : std::vector<std::pair<double, double>>{
           {-23.0, -40.0}, {0.0, -15.0}, {1.2, -3.0}, {-3000.0, -3001.0}}) {
    EXPECT_TRUE(findingsOf(vehicle_z_m, seabed_z_m).empty());
  }
}

TEST(BeamGeometry, PassesSomeBadBeamsAndSomeBadPings) {
  BeamGeometry check;
  for (int k = 0; k < 200; ++k) {
    Beams levelled = seabedAt(-40.0);
    for (Eigen::Index i = 0; i < 3; ++i) levelled(2, i) = 10.0F;  // echoes of the surface
    if (k % 20 < 3) levelled = seabedAt(30.0);
    check.add({-20.0, 0.0, 0.0}, levelled);
  }
  EXPECT_TRUE(check.findings().empty());
}

TEST(BeamGeometry, FindsPingsWithZDown) {
  const auto findings = findingsOf(-23.0, -5.7);
  ASSERT_EQ(findings.size(), 1U);
  EXPECT_EQ(findings[0].name, "beams_above_vehicle");
  EXPECT_EQ(findings[0].severity, Severity::kError);
  EXPECT_TRUE(says(findings[0], "z_down")) << findings[0].text;
  EXPECT_TRUE(says(findings[0], "200 of the 200 beams of 20 pings")) << findings[0].text;
  EXPECT_TRUE(says(findings[0], "vehicle at z = -23.0 m")) << findings[0].text;
  EXPECT_TRUE(says(findings[0], "the seabed lies at z = -40.4 m")) << findings[0].text;
}

TEST(BeamGeometry, FindsZDownInEverything) {
  const auto findings = findingsOf(23.0, 40.0);
  ASSERT_EQ(findings.size(), 2U);
  EXPECT_EQ(findings[0].name, "beams_above_vehicle");
  EXPECT_TRUE(says(findings[0], "the odometry and the pings alike")) << findings[0].text;
  EXPECT_TRUE(says(findings[0], "vehicle at z = -23.0 m")) << findings[0].text;
  EXPECT_EQ(findings[1].name, "seabed_above_sea");
  EXPECT_TRUE(says(findings[1], "z_down")) << findings[1].text;
}

TEST(BeamGeometry, FindsADepthInPlaceOfZ) {
  const auto findings = findingsOf(23.0, 6.0);
  ASSERT_EQ(findings.size(), 1U);
  EXPECT_EQ(findings[0].name, "seabed_above_sea");
  EXPECT_EQ(findings[0].severity, Severity::kWarning);  // a lake in the mountains looks alike
  EXPECT_TRUE(says(findings[0], "positive down")) << findings[0].text;
  EXPECT_TRUE(says(findings[0], "at z = -39.9 m")) << findings[0].text;
}

TEST(BeamGeometry, FindsBothAboveAVehicleAtTheSurface) {
  const auto findings = findingsOf(0.0, 17.0);
  ASSERT_EQ(findings.size(), 2U);
  EXPECT_TRUE(says(findings[0], "upside down")) << findings[0].text;
}

TEST(BeamGeometry, WaitsForTwentyPingsAndKeepsWhatItHasFound) {
  EXPECT_TRUE(findingsOf(-23.0, -5.7, 19).empty());
  EXPECT_EQ(findingsOf(-23.0, -5.7, 20).size(), 1U);
  BeamGeometry check;
  for (int k = 0; k < 100; ++k) check.add({-23.0, 0.0, 0.0}, seabedAt(k < 50 ? -5.7 : -40.0));
  EXPECT_EQ(check.findings().size(), 1U);
}

TEST(BeamGeometry, FindsWhatBeginsInTheMiddleOfASurvey) {
  BeamGeometry check;
  for (int k = 0; k < 1000; ++k) check.add({-23.0, 0.0, 0.0}, seabedAt(k < 900 ? -40.0 : -5.7));
  EXPECT_EQ(check.findings().size(), 1U);
}

// ---- the survey area ---------------------------------------------------------------------------

const std::vector<Eigen::Vector2d> kSquare = {
    {0.0, 0.0}, {100.0, 0.0}, {100.0, 100.0}, {0.0, 100.0}};

// One beam where it is said, whatever the pose.
void beamAt(AreaCoverage* check, const Pose2& pose, double x_m, double y_m) {
  const double c = std::cos(pose.yaw_rad);
  const double s = std::sin(pose.yaw_rad);
  const double dx = x_m - pose.x_m;
  const double dy = y_m - pose.y_m;
  Beams beam(3, 1);
  beam << static_cast<float>(c * dx + s * dy), static_cast<float>(-s * dx + c * dy), -40.0F;
  check->add(pose, beam);
}

TEST(AreaCoverage, CountsTheBeamsInside) {
  AreaCoverage check(kSquare);
  EXPECT_TRUE(std::isnan(check.share()));
  int inside = 0;
  for (int k = 0; k < 400; ++k) {
    const double x_m = -95.0 + 10.0 * (k % 20);
    const double y_m = -95.0 + 10.0 * (k / 20);
    beamAt(&check, {50.0, 60.0, 0.1 * k}, x_m, y_m);
    if (x_m > 0.0 && y_m > 0.0) ++inside;
  }
  EXPECT_DOUBLE_EQ(check.share(), inside / 400.0);
  check.finish();
  EXPECT_FALSE(check.finding().has_value());
}

TEST(AreaCoverage, KnowsAreasOfAnyShape) {
  // an L, closed as some tools close their rings, far from the origin
  const Eigen::Vector2d o(500000.0, 6400000.0);
  std::vector<Eigen::Vector2d> area;
  for (const auto& [x_m, y_m] : std::vector<std::pair<double, double>>{
           {0, 0}, {100, 0}, {100, 40}, {40, 40}, {40, 100}, {0, 100}, {0, 0}}) {
    area.emplace_back(o.x() + x_m, o.y() + y_m);
  }
  const auto shareAt = [&](double x_m, double y_m) {
    AreaCoverage check(area);
    beamAt(&check, {o.x(), o.y(), 0.7}, o.x() + x_m, o.y() + y_m);
    return check.share();
  };
  EXPECT_EQ(shareAt(20, 80), 1.0);
  EXPECT_EQ(shareAt(80, 20), 1.0);
  EXPECT_EQ(shareAt(80, 80), 0.0);
  EXPECT_EQ(shareAt(-5, 20), 0.0);
  EXPECT_EQ(shareAt(120, 20), 0.0);
}

TEST(AreaCoverage, WarnsAfterTwoHundredPingsAndTakesItBack) {
  AreaCoverage check(kSquare);
  for (int k = 0; k < 199; ++k) beamAt(&check, {}, -50.0, 50.0);
  EXPECT_FALSE(check.finding().has_value());
  beamAt(&check, {}, -50.0, 50.0);
  ASSERT_TRUE(check.finding().has_value());
  EXPECT_EQ(check.finding()->name, "area_missed");
  EXPECT_EQ(check.finding()->severity, Severity::kWarning);
  beamAt(&check, {}, 50.0, 50.0);  // the vehicle has come on station
  EXPECT_FALSE(check.finding().has_value());
}

TEST(AreaCoverage, IsAnErrorAtTheEnd) {
  AreaCoverage check(kSquare);
  for (int k = 0; k < 5; ++k) beamAt(&check, {}, -50.0, 150.0 + k);
  EXPECT_FALSE(check.finding().has_value());
  check.finish();
  ASSERT_TRUE(check.finding().has_value());
  EXPECT_EQ(check.finding()->severity, Severity::kError);
  EXPECT_TRUE(says(*check.finding(), "beams x -50 to -50 m, y 150 to 154 m"))
      << check.finding()->text;
  EXPECT_TRUE(says(*check.finding(), "survey_area x 0 to 100 m, y 0 to 100 m"));
  EXPECT_FALSE(says(*check.finding(), "UTM"));
}

TEST(AreaCoverage, AsksForUtmWhenTheyLieFarApart) {
  AreaCoverage check(kSquare);
  for (int k = 0; k < 5; ++k) beamAt(&check, {500000.0, 6400000.0, 1.0}, 500010.0, 6400020.0);
  check.finish();
  EXPECT_TRUE(says(*check.finding(), "UTM")) << check.finding()->text;
  EXPECT_TRUE(says(*check.finding(), "6419 km apart")) << check.finding()->text;
}

TEST(AreaCoverage, SaysNothingWithoutAnAreaOrWithoutPings) {
  AreaCoverage no_area({});
  beamAt(&no_area, {}, 1.0, 1.0);
  no_area.finish();
  EXPECT_FALSE(no_area.finding().has_value());
  AreaCoverage no_pings(kSquare);
  no_pings.finish();
  EXPECT_FALSE(no_pings.finding().has_value());
}

// ---- all of them -------------------------------------------------------------------------------

// The filter's circle of 20 m about (-0.9, 25.1); its odometry's pose stands still.
TEST(SurveyChecks, AreFedFromTheFilter) {
  ParticleFilter filter(quietParams());
  SurveyChecks checks(Velocity::kAuto, {{200.0, 0.0}, {300.0, 0.0}, {300.0, 100.0}});
  SurveyChecks right(Velocity::kAuto, {{-100.0, -100.0}, {100.0, -100.0}, {0.0, 200.0}});
  for (int k = 0; k < 60; ++k) {
    filter.addOdometry(turning(k));
    Ping ping = pingAt(k);
    ping.beams_m.row(2) *= -1.0F;
    filter.addPing(ping);
    for (SurveyChecks* each : {&checks, &right}) each->add(turning(k));
  }
  for (const SurveyPing& ping : filter.snapshot().survey(0, 100)) {
    checks.add(ping);
    right.add(ping);
  }
  checks.finish();
  right.finish();
  std::vector<std::string> names;
  for (const Finding& finding : checks.findings()) names.push_back(finding.name);
  EXPECT_EQ(names, (std::vector<std::string>{"beams_above_vehicle", "seabed_above_sea",
                                             "twist_against_pose", "area_missed"}));
  EXPECT_EQ(right.findings().size(), 3U);
  EXPECT_EQ(right.areaCoverage().share(), 1.0);
}

}  // namespace
}  // namespace rbpf_core
