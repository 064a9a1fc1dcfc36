// The odometry's twist against its pose: good surveys pass, and what is wrong is named.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "rbpf_core/random.hpp"
#include "rbpf_core/twist_against_pose.hpp"

namespace rbpf_core {
namespace {

constexpr double kRadPerDegree = M_PI / 180.0;

// A lawn-mower survey: legs, half turns to either side in turn, a vehicle that rolls and pitches.
struct Survey {
  double heading_rad = 0.4;
  double speed_mps = 1.5;
  double leg_s = 70.0;
  double yaw_rate_radps = 0.15;
  double rate_hz = 10.0;
  double duration_s = 600.0;
  std::uint64_t seed = 1;
  // Of dead reckoning, per square root of a second, and its gyro's bias.
  double drift_m = 0.08;
  double drift_rad = 0.0025;
  double bias_radps = 0.0005;
  // The pose: the twist's own integral, or the truth with steps of so much every 15 s.
  bool pose_is_integral = false;
  double correction_m = 0.4;
  double correction_rad = 0.01;
};

double yawRateAt(const Survey& survey, double t) {
  const double turn_s = M_PI / survey.yaw_rate_radps;
  const double period_s = survey.leg_s + turn_s;
  const auto leg = static_cast<int>(t / period_s);
  if (t - leg * period_s < survey.leg_s) return 0.0;
  return leg % 2 == 0 ? survey.yaw_rate_radps : -survey.yaw_rate_radps;
}

// What a levelled twist is in a rolling and pitching vehicle that turns.
void setTwist(const Eigen::Vector3d& levelled_mps, double yaw_rate_radps, Odometry* odometry) {
  const Eigen::Matrix3d R =
      levelRotation(odometry->attitude.roll_rad, odometry->attitude.pitch_rad).transpose();
  odometry->linear_mps = R * levelled_mps;
  odometry->angular_radps = R * Eigen::Vector3d(0.0, 0.0, yaw_rate_radps);
}

std::vector<Odometry> sail(const Survey& survey) {
  RandomStream stream(survey.seed);
  std::normal_distribution<double> normal;
  const double dt = 1.0 / survey.rate_hz;
  Pose2 truth{100.0, -50.0, survey.heading_rad};
  Pose2 integral = truth;
  Pose2 correction;
  std::vector<Odometry> messages;
  for (int k = 0; k < survey.duration_s * survey.rate_hz; ++k) {
    const double t = k * dt;
    const double yaw_rate = yawRateAt(survey, t);
    if (k % static_cast<int>(15.0 * survey.rate_hz) == 0) {
      correction = {survey.correction_m * normal(stream), survey.correction_m * normal(stream),
                    survey.correction_rad * normal(stream)};
    }
    Odometry odometry;
    odometry.stamp_s = 1e9 + t;
    odometry.attitude = {-20.0, 0.1 * std::sin(t), 0.05 * std::cos(0.7 * t)};
    const double noise_mps = survey.drift_m / std::sqrt(dt);
    const Eigen::Vector3d levelled_mps(survey.speed_mps + noise_mps * normal(stream),
                                       noise_mps * normal(stream), 0.0);
    const double measured_radps =
        yaw_rate + survey.bias_radps + survey.drift_rad / std::sqrt(dt) * normal(stream);
    setTwist(levelled_mps, measured_radps, &odometry);
    odometry.pose = survey.pose_is_integral
                        ? integral
                        : Pose2{truth.x_m + correction.x_m, truth.y_m + correction.y_m,
                                wrapAngle(truth.yaw_rad + correction.yaw_rad)};
    messages.push_back(odometry);
    truth = advance(truth, {dt, survey.speed_mps * dt, 0.0, yaw_rate * dt});
    integral =
        advance(integral, {dt, levelled_mps.x() * dt, levelled_mps.y() * dt, measured_radps * dt});
  }
  return messages;
}

// Surveys that differ in everything that should not matter.
std::vector<Survey> variety() {
  std::vector<Survey> surveys;
  for (const double heading_rad : {0.0, 0.4, M_PI / 2.0, -2.8}) {
    Survey survey;
    survey.heading_rad = heading_rad;
    survey.seed = surveys.size();
    surveys.push_back(survey);
    survey.pose_is_integral = true;
    surveys.push_back(survey);
  }
  for (const double rate_hz : {1.0, 2.0, 5.0, 50.0}) {
    Survey survey;
    survey.rate_hz = rate_hz;
    survey.seed = 100 + surveys.size();
    surveys.push_back(survey);
  }
  for (const double speed_mps : {0.7, 3.0, 5.0}) {
    Survey survey;
    survey.speed_mps = speed_mps;
    survey.seed = 200 + surveys.size();
    surveys.push_back(survey);
  }
  Survey quick_turns;
  quick_turns.yaw_rate_radps = 0.5;
  quick_turns.leg_s = 150.0;
  quick_turns.duration_s = 1200.0;
  surveys.push_back(quick_turns);
  Survey long_ago;
  long_ago.leg_s = 20.0;
  long_ago.yaw_rate_radps = 0.08;
  surveys.push_back(long_ago);
  return surveys;
}

using Change = std::function<void(Odometry*)>;

std::vector<Odometry> changed(std::vector<Odometry> messages, const Change& change) {
  for (Odometry& message : messages) change(&message);
  return messages;
}

Eigen::Matrix3d rotationOf(const Odometry& o) {
  return Eigen::AngleAxisd(o.pose.yaw_rad, Eigen::Vector3d::UnitZ()) *
         levelRotation(o.attitude.roll_rad, o.attitude.pitch_rad);
}

// The change is found in every survey of the variety, and put down to the right cause.
void expectFound(const Change& change, const std::string& cause) {
  const std::vector<Survey> surveys = variety();
  for (std::size_t i = 0; i < surveys.size(); ++i) {
    SCOPED_TRACE("survey " + std::to_string(i));
    const auto finding = twistAgainstPose(changed(sail(surveys[i]), change), Velocity::kTwist);
    ASSERT_TRUE(finding.has_value());
    EXPECT_EQ(finding->name, "twist_against_pose");
    EXPECT_EQ(finding->severity, Severity::kError);
    EXPECT_NE(finding->text.find(cause), std::string::npos) << finding->text;
  }
}

// ---- what is right -----------------------------------------------------------------------------

TEST(TwistAgainstPose, PassesEverySurveyThatOnlyDrifts) {
  for (const Survey& survey : variety()) {
    const auto finding = twistAgainstPose(sail(survey), Velocity::kTwist);
    EXPECT_FALSE(finding.has_value()) << finding->text;
  }
}

TEST(TwistAgainstPose, PassesLongSurveysOfManySeeds) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    Survey survey;
    survey.seed = 1000 + seed;
    survey.duration_s = 3600.0;
    survey.rate_hz = 5.0;
    survey.pose_is_integral = seed % 2 == 0;
    survey.bias_radps = 0.002;
    const auto finding = twistAgainstPose(sail(survey), Velocity::kTwist);
    EXPECT_FALSE(finding.has_value()) << finding->text;
  }
}

TEST(TwistAgainstPose, PassesAVehicleAtRestWhosePoseJumps) {
  for (const double rate_hz : {1.0, 10.0}) {
    Survey survey;
    survey.speed_mps = 0.0;
    survey.leg_s = 1e9;
    survey.rate_hz = rate_hz;
    survey.duration_s = 3600.0;
    survey.correction_m = 1.5;
    survey.correction_rad = 0.15;
    const auto finding = twistAgainstPose(sail(survey), Velocity::kTwist);
    EXPECT_FALSE(finding.has_value()) << finding->text;
  }
}

TEST(TwistAgainstPose, PassesANoisyPose) {
  for (const double speed_mps : {0.0, 1.5}) {
    for (const double rate_hz : {1.0, 10.0}) {
      Survey survey;
      survey.speed_mps = speed_mps;
      survey.leg_s = 1e9;
      survey.rate_hz = rate_hz;
      survey.duration_s = 3600.0;
      RandomStream stream(survey.seed);
      std::normal_distribution<double> normal;
      const auto noisy = changed(sail(survey), [&](Odometry* o) {  // GPS and a compass
        o->pose.x_m += 1.0 * normal(stream);
        o->pose.y_m += 1.0 * normal(stream);
        o->pose.yaw_rad += 0.05 * normal(stream);
      });
      const auto finding = twistAgainstPose(noisy, Velocity::kTwist);
      EXPECT_FALSE(finding.has_value()) << finding->text;
    }
  }
}

TEST(TwistAgainstPose, PassesOneGrossCorrectionOfThePose) {
  std::vector<Odometry> messages = sail({});
  for (std::size_t k = 3000; k < messages.size(); ++k) messages[k].pose.x_m += 80.0;
  messages[1000].pose.yaw_rad += 2.0;
  messages[1500].linear_mps *= 1e6;
  EXPECT_FALSE(twistAgainstPose(messages, Velocity::kTwist).has_value());
}

TEST(TwistAgainstPose, LooksAwayInGaps) {
  std::vector<Odometry> messages;
  for (const Odometry& message : sail({})) {  // 12 s of every 60
    if (std::fmod(message.stamp_s - 1e9, 60.0) < 12.0) messages.push_back(message);
  }
  EXPECT_FALSE(twistAgainstPose(messages, Velocity::kTwist).has_value());
}

TEST(TwistAgainstPose, LeavesOutWhatComesTwiceOrOutOfOrder) {
  const std::vector<Odometry> messages = sail({});
  std::vector<Odometry> shuffled;
  for (std::size_t k = 0; k < messages.size(); ++k) {
    shuffled.push_back(messages[k]);
    shuffled.push_back(messages[k]);
    if (k % 20 == 5) shuffled.push_back(messages[k - 3]);
    Odometry timeless = messages[k];
    timeless.stamp_s = std::nan("");
    if (k % 300 == 50) shuffled.push_back(timeless);
    timeless.stamp_s = 1e300;
    if (k % 300 == 60) shuffled.push_back(timeless);
  }
  EXPECT_FALSE(twistAgainstPose(shuffled, Velocity::kTwist).has_value());
}

// ---- what is wrong -----------------------------------------------------------------------------

TEST(TwistAgainstPose, NamesAnEmptyTwist) {
  expectFound(
      [](Odometry* o) {
        o->linear_mps.setZero();
        o->angular_radps.setZero();
      },
      "the twist is empty");
}

TEST(TwistAgainstPose, NamesMissingRates) {
  expectFound([](Odometry* o) { o->angular_radps.setZero(); }, "yaw rate is missing");
}

TEST(TwistAgainstPose, NamesRatesInDegrees) {
  expectFound([](Odometry* o) { o->angular_radps /= kRadPerDegree; }, "degrees a second");
}

TEST(TwistAgainstPose, NamesATwistInTheOdometrysFrame) {
  expectFound(
      [](Odometry* o) {
        const Eigen::Matrix3d R = rotationOf(*o);
        o->linear_mps = R * o->linear_mps;
        o->angular_radps = R * o->angular_radps;
      },
      "in the odometry's frame");
  expectFound([](Odometry* o) { o->linear_mps = rotationOf(*o) * o->linear_mps; },
              "in the odometry's frame");
}

TEST(TwistAgainstPose, NamesAYawRateOfTheWrongSign) {
  expectFound([](Odometry* o) { o->angular_radps.z() *= -1.0; }, "wrong sign");
  // forward, right, down
  expectFound(
      [](Odometry* o) {
        o->linear_mps.tail<2>() *= -1.0;
        o->angular_radps.tail<2>() *= -1.0;
      },
      "wrong sign");
}

TEST(TwistAgainstPose, NamesKnots) {
  expectFound([](Odometry* o) { o->linear_mps /= 0.514444; }, "knots");
}

TEST(TwistAgainstPose, SaysSoWhenItKnowsNoCause) {
  expectFound([](Odometry* o) { o->linear_mps *= 3.28; }, "none of the usual ones");
  const auto sideways =
      changed(sail({}), [](Odometry* o) { std::swap(o->linear_mps.x(), o->linear_mps.y()); });
  EXPECT_NE(twistAgainstPose(sideways, Velocity::kTwist)->text.find("none of the usual ones"),
            std::string::npos);
}

TEST(TwistAgainstPose, GivesBothFigures) {
  Survey quiet;
  quiet.drift_m = quiet.drift_rad = quiet.bias_radps = 0.0;
  quiet.correction_m = quiet.correction_rad = 0.0;
  const auto messages = changed(sail(quiet), [](Odometry* o) { o->linear_mps /= 0.514444; });
  const auto finding = twistAgainstPose(messages, Velocity::kTwist);
  ASSERT_TRUE(finding.has_value());
  EXPECT_NE(finding->text.find("the twist leads to (29.2, 0.0) m"), std::string::npos)
      << finding->text;
  EXPECT_NE(finding->text.find("the pose to (15.0, 0.0) m"), std::string::npos) << finding->text;
}

TEST(TwistAgainstPose, FindsItInThreeWindows) {
  TwistAgainstPose check;
  double seconds = 0.0;
  for (const Odometry& message : sail({})) {
    Odometry in_knots = message;
    in_knots.linear_mps /= 0.514444;
    check.add(in_knots);
    seconds = message.stamp_s - 1e9;
    if (check.finding()) break;
  }
  ASSERT_TRUE(check.finding().has_value());
  EXPECT_NEAR(seconds, 30.0, 1.0);  // three windows
}

// ---- what matters ------------------------------------------------------------------------------

TEST(TwistAgainstPose, WarnsOnlyOfATwistThatIsNotUsed) {
  const auto severityOf = [](const std::vector<Odometry>& messages, Velocity velocity) {
    return twistAgainstPose(messages, velocity).value().severity;
  };
  const auto empty = changed(sail({}), [](Odometry* o) {
    o->linear_mps.setZero();
    o->angular_radps.setZero();
  });
  EXPECT_EQ(severityOf(empty, Velocity::kTwist), Severity::kError);
  EXPECT_EQ(severityOf(empty, Velocity::kAuto), Severity::kWarning);  // the pose is used
  EXPECT_EQ(severityOf(empty, Velocity::kPose), Severity::kWarning);
  const auto degrees = changed(sail({}), [](Odometry* o) { o->angular_radps /= kRadPerDegree; });
  EXPECT_EQ(severityOf(degrees, Velocity::kTwist), Severity::kError);
  EXPECT_EQ(severityOf(degrees, Velocity::kAuto), Severity::kError);
  EXPECT_EQ(severityOf(degrees, Velocity::kPose), Severity::kWarning);
  const auto no_pose = changed(sail({}), [](Odometry* o) { o->pose = {}; });
  EXPECT_EQ(severityOf(no_pose, Velocity::kTwist), Severity::kWarning);
  EXPECT_EQ(severityOf(no_pose, Velocity::kAuto), Severity::kWarning);
  EXPECT_EQ(severityOf(no_pose, Velocity::kPose), Severity::kError);
  EXPECT_NE(twistAgainstPose(no_pose, Velocity::kAuto)->text.find("pose is not filled in"),
            std::string::npos);
}

}  // namespace
}  // namespace rbpf_core
