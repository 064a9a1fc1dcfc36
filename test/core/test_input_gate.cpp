// Messages of another time, messages that come twice, and values that no vehicle has.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "rbpf_core/input_gate.hpp"
#include "rbpf_core/mount_gate.hpp"
#include "survey.hpp"

namespace rbpf_core {
namespace {

constexpr double kNow_s = 1.7e9;
const std::vector<double> kAbsurd_s = {1e300,
                                       -1e300,
                                       1e19,
                                       4294967296.0,
                                       std::numeric_limits<double>::max(),
                                       std::numeric_limits<double>::infinity(),
                                       -std::numeric_limits<double>::infinity(),
                                       std::numeric_limits<double>::quiet_NaN()};

std::optional<Reason> reasonOf(const std::optional<Refusal>& refusal) {
  if (!refusal) return std::nullopt;
  EXPECT_LT(std::string(refusal->what()).size(), 400U);
  return refusal->reason();
}

std::optional<Reason> check(InputGate& gate, double stamp_s, double receipt_s) {
  return reasonOf(gate.check(straight(stamp_s), receipt_s));
}

// ---- clocks ------------------------------------------------------------------------------------

TEST(GateClock, PassesEverythingOfAGoodSurvey) {
  InputGate gate({});
  for (int k = 0; k < 5000; ++k) {
    const double stamp_s = kNow_s + 0.1 * k;
    EXPECT_EQ(check(gate, stamp_s, stamp_s + 0.02 * (k % 7)), std::nullopt);
    EXPECT_FALSE(gate.checkPing(stamp_s - 0.03, "mbes", stamp_s + 15.0).has_value());
    EXPECT_FALSE(gate.checkPing(stamp_s - 0.03, "mbes_port", stamp_s).has_value());
  }
}

TEST(GateClock, HasBoundsOnEitherSide) {
  ClockParams clock;
  for (const auto& [ahead_s, behind_s] :
       std::vector<std::pair<double, double>>{{10.0, 3600.0}, {1.0, 30.0}, {0.0, 0.0}}) {
    clock = {ahead_s, behind_s};
    const auto at = [&](double difference_s) {
      InputGate gate({clock, {}, {}});
      const auto ping = reasonOf(gate.checkPing(kNow_s + difference_s, "mbes", kNow_s));
      EXPECT_EQ(check(gate, kNow_s + difference_s, kNow_s), ping);
      return ping;
    };
    EXPECT_EQ(at(ahead_s), std::nullopt);
    EXPECT_EQ(at(-behind_s), std::nullopt);
    EXPECT_EQ(at(ahead_s + 0.01), Reason::kClockAhead);
    EXPECT_EQ(at(-behind_s - 0.01), Reason::kClockBehind);
  }
}

TEST(GateClock, LosesOneMessageToOneStampFromTheFuture) {
  InputGate gate({});
  for (int k = 0; k < 100; ++k) {
    const double stamp_s = kNow_s + 0.1 * k;
    if (k % 10 == 5) {
      for (const double jump_s : {3600.0, 11.0, 1e9}) {
        EXPECT_EQ(check(gate, stamp_s + jump_s, stamp_s), Reason::kClockAhead);
        EXPECT_EQ(reasonOf(gate.checkPing(stamp_s + jump_s, "mbes", stamp_s)), Reason::kClockAhead);
      }
    }
    EXPECT_EQ(check(gate, stamp_s, stamp_s), std::nullopt);
    EXPECT_FALSE(gate.checkPing(stamp_s, "mbes", stamp_s).has_value());
  }
}

TEST(GateClock, WaitsForAClockThatIsSetLate) {
  InputGate gate({});
  for (int k = 0; k < 200; ++k) {
    EXPECT_EQ(check(gate, 5.0 + 0.1 * k, kNow_s + 0.1 * k), Reason::kClockBehind);
  }
  for (int k = 200; k < 300; ++k) {
    EXPECT_EQ(check(gate, kNow_s + 0.1 * k, kNow_s + 0.1 * k), std::nullopt);
  }
}

TEST(GateClock, AsksForTheSonarsWhenOnlyPingsAreAhead) {
  InputGate gate({});
  const auto refusal = gate.checkPing(kNow_s + 3600.0, "mbes", kNow_s);
  ASSERT_TRUE(refusal.has_value());
  EXPECT_STREQ(refusal->what(),
               "ping of stamp 1700003600.000 s from 'mbes' is 3600.000 s ahead of its receipt, "
               "expected at most 10.000 s. Is the sonar's clock set?");
}

TEST(GateClock, SurvivesAbsurdStampsAndReceipts) {
  InputGate gate({});
  EXPECT_EQ(check(gate, kNow_s, kNow_s), std::nullopt);
  for (const double absurd_s : kAbsurd_s) {
    EXPECT_NE(check(gate, absurd_s, kNow_s), std::nullopt);
    EXPECT_TRUE(gate.checkPing(absurd_s, "mbes", kNow_s).has_value());
    EXPECT_TRUE(gate.checkPing(kNow_s, "mbes", absurd_s).has_value());
  }
  EXPECT_EQ(check(gate, kNow_s + 0.1, kNow_s + 0.1), std::nullopt);
  EXPECT_FALSE(gate.checkPing(kNow_s, "mbes", kNow_s).has_value());
}

TEST(GateClock, RefusesAStampOfZeroAsNone) {
  InputGate gate({});
  EXPECT_EQ(check(gate, 0.0, kNow_s), Reason::kNoStamp);
  EXPECT_EQ(check(gate, 0.0, 0.0), Reason::kNoStamp);
  EXPECT_EQ(reasonOf(gate.checkPing(0.0, "mbes", 1.0)), Reason::kNoStamp);
  EXPECT_EQ(check(gate, 0.1, 0.1), std::nullopt);  // simulated time begins near 0
}

// ---- recordings whose receipts are another clock's ----------------------------------------------

TEST(ClockOffset, IsTheMedianOnlyBeyondTheBounds) {
  const auto offset = [](std::vector<double> differences_s) {
    return clockOffset(std::move(differences_s), {});
  };
  EXPECT_EQ(offset({}), 0.0);
  EXPECT_EQ(offset({-0.1, -0.2, -0.05}), 0.0);
  EXPECT_EQ(offset({-15.0, -16.0, 3600.0}), 0.0);
  EXPECT_EQ(offset({-1e8, -1e8, -0.1, -1e8}), -1e8);
  EXPECT_EQ(offset({500.0, 500.1, 499.9}), 500.0);
  // a clock that was set late, in a minority of the messages
  EXPECT_EQ(offset({-1.7e9, -1.7e9, -0.1, -0.1, -0.1}), 0.0);
}

TEST(ClockOffset, LetsSuchARecordingPassWithTheBoundsAboutIt) {
  // a bag written years later by a tool, its record times from then
  const double offset_s = -3e8;
  InputGate gate({}, offset_s);
  for (int k = 0; k < 50; ++k) {
    const double stamp_s = kNow_s + 0.1 * k;
    EXPECT_EQ(check(gate, stamp_s, stamp_s - offset_s), std::nullopt);
    EXPECT_FALSE(gate.checkPing(stamp_s, "mbes", stamp_s - offset_s).has_value());
    EXPECT_EQ(check(gate, stamp_s + 3600.0, stamp_s - offset_s), Reason::kClockAhead);
  }
}

// ---- order
// ---------------------------------------------------------------------------------------

TEST(GateOrder, RefusesOdometryThatIsNotLater) {
  InputGate gate({});
  EXPECT_EQ(check(gate, kNow_s, kNow_s), std::nullopt);
  EXPECT_EQ(check(gate, kNow_s, kNow_s), Reason::kDuplicateStamp);
  EXPECT_EQ(check(gate, kNow_s - 1.0, kNow_s), Reason::kOutOfOrder);
  EXPECT_EQ(check(gate, kNow_s + 0.1, kNow_s), std::nullopt);
  // a bag that loops
  for (int k = 0; k < 10; ++k) {
    EXPECT_EQ(check(gate, kNow_s - 100.0 + k, kNow_s + k), Reason::kOutOfOrder);
  }
}

TEST(GateOrder, TakesPingsInAnyOrderButEachOnce) {
  InputGate gate({});
  for (const double age_s : {0.5, 0.3, 0.4, 0.1, 2.0}) {
    EXPECT_FALSE(gate.checkPing(kNow_s - age_s, "mbes", kNow_s).has_value());
  }
  for (const double age_s : {0.5, 0.1, 2.0}) {
    EXPECT_EQ(reasonOf(gate.checkPing(kNow_s - age_s, "mbes", kNow_s)), Reason::kDuplicateStamp);
    EXPECT_FALSE(gate.checkPing(kNow_s - age_s, "mbes_port", kNow_s).has_value());
  }
}

TEST(GateOrder, ForgetsPingsOnlyWhenTheyAreOld) {
  InputGate gate({});
  constexpr int kPings = 20000;  // 400 s at 50 Hz
  const auto at = [&](int k) {
    return gate.checkPing(kNow_s + 0.02 * k, "mbes", kNow_s + 0.02 * k);
  };
  for (int k = 0; k < kPings; ++k) {
    EXPECT_FALSE(at(k).has_value());
    if (k >= 3000) {
      EXPECT_TRUE(at(k - 3000).has_value());  // a minute ago
    }
  }
}

// ---- values
// --------------------------------------------------------------------------------------

TEST(GatePlausibility, BoundsTheTwist) {
  const auto with = [](const Eigen::Vector3d& linear_mps, const Eigen::Vector3d& angular_radps) {
    InputGate gate({});
    Odometry odometry = straight(kNow_s);
    odometry.linear_mps = linear_mps;
    odometry.angular_radps = angular_radps;
    return reasonOf(gate.check(odometry, kNow_s));
  };
  EXPECT_EQ(with({20.0, 0.0, 0.0}, {0.0, 0.0, 3.0}), std::nullopt);
  EXPECT_EQ(with({-5.0, 5.0, 2.0}, {1.0, -1.0, 1.0}), std::nullopt);
  EXPECT_EQ(with({20.1, 0.0, 0.0}, {0.0, 0.0, 0.0}), Reason::kImplausibleTwist);
  EXPECT_EQ(with({0.0, -15.0, 15.0}, {0.0, 0.0, 0.0}), Reason::kImplausibleTwist);
  EXPECT_EQ(with({1.0, 0.0, 0.0}, {0.0, 0.0, -3.1}), Reason::kImplausibleTwist);
  EXPECT_EQ(with({1e200, 0.0, 0.0}, {0.0, 0.0, 0.0}), Reason::kImplausibleTwist);
  EXPECT_EQ(with({1.0, std::nan(""), 0.0}, {0.0, 0.0, 0.0}), Reason::kImplausibleTwist);
}

TEST(GatePlausibility, DoesNotMindATwistThatIsNotUsed) {
  GateParams params;
  params.odometry.velocity = Velocity::kPose;
  InputGate gate(params);
  Odometry odometry = straight(kNow_s);
  odometry.linear_mps.x() = 500.0;
  EXPECT_FALSE(gate.check(odometry, kNow_s).has_value());
}

TEST(GatePlausibility, BoundsTheDepth) {
  for (const double z_m : {-11000.0, 0.0, 500.0}) {
    InputGate gate({});
    Odometry odometry = straight(kNow_s);
    odometry.attitude.z_m = z_m;
    EXPECT_FALSE(gate.check(odometry, kNow_s).has_value());
  }
  for (const double z_m : {-23000.0, 12001.0, 1e300}) {
    InputGate gate({});
    Odometry odometry = straight(kNow_s);
    odometry.attitude.z_m = z_m;
    EXPECT_EQ(reasonOf(gate.check(odometry, kNow_s)), Reason::kImplausiblePose);
  }
}

// A pose that goes along x at 1 m/s, as found every 0.2 s.
Odometry poseAt(int k, double x_m) {
  Odometry odometry;
  odometry.stamp_s = kNow_s + 0.2 * k;
  odometry.pose.x_m = x_m;
  return odometry;
}

TEST(GatePlausibility, BoundsThePosesMotionWhereItIsUsed) {
  for (const Velocity velocity : {Velocity::kPose, Velocity::kAuto}) {  // the twist is empty
    GateParams params;
    params.odometry.velocity = velocity;
    InputGate gate(params);
    for (int k = 0; k < 100; ++k) {
      const bool outlier = k % 10 == 5;
      const auto refusal = gate.check(poseAt(k, outlier ? 500.0 : 0.2 * k), kNow_s + 0.2 * k);
      EXPECT_EQ(refusal.has_value(), outlier);
      if (refusal) {
        EXPECT_EQ(refusal->reason(), Reason::kImplausiblePose);
      }
    }
  }
  GateParams by_twist;
  by_twist.odometry.velocity = Velocity::kTwist;
  InputGate gate(by_twist);
  EXPECT_FALSE(gate.check(poseAt(0, 0.0), kNow_s).has_value());
  EXPECT_FALSE(gate.check(poseAt(1, 500.0), kNow_s).has_value());
}

TEST(GatePlausibility, GoesOnAfterAJumpOfThePose) {
  GateParams params;
  params.odometry.velocity = Velocity::kPose;
  InputGate gate(params);
  int refused = 0;
  for (int k = 0; k < 100; ++k) {
    refused +=
        gate.check(poseAt(k, (k < 50 ? 0.0 : 100.0) + 0.2 * k), kNow_s + 0.2 * k).has_value();
  }
  // 100 m at 20 m/s
  EXPECT_GE(refused, 20);
  EXPECT_LE(refused, 30);
}

TEST(GatePlausibility, BoundsThePosesMotionOverALongGap) {
  InputGate gate({});
  EXPECT_FALSE(gate.check(straight(kNow_s), kNow_s).has_value());
  Odometry after = straight(kNow_s + 60.0);
  after.pose.x_m += 500000.0;
  EXPECT_EQ(reasonOf(gate.check(after, kNow_s + 60.0)), Reason::kImplausiblePose);
  EXPECT_FALSE(gate.check(straight(kNow_s + 60.0), kNow_s + 60.0).has_value());
}

TEST(GatePlausibility, IsAParameterEach) {
  GateParams params;
  params.plausibility.max_speed_mps = 1.9;
  params.plausibility.max_depth_m = 11.0;
  EXPECT_EQ(reasonOf(InputGate(params).check(straight(kNow_s), kNow_s)), Reason::kImplausibleTwist);
  params.plausibility.max_speed_mps = 2.0;
  EXPECT_FALSE(InputGate(params).check(straight(kNow_s), kNow_s).has_value());
  params.plausibility.max_depth_m = 9.0;
  EXPECT_EQ(reasonOf(InputGate(params).check(straight(kNow_s), kNow_s)), Reason::kImplausiblePose);
  params.plausibility.max_depth_m = 11.0;
  params.plausibility.max_turn_rate_radps = 0.05;
  EXPECT_EQ(reasonOf(InputGate(params).check(turning(kNow_s), kNow_s)), Reason::kImplausibleTwist);
}

// ---- mounts
// --------------------------------------------------------------------------------------

Eigen::Isometry3d mountAt(double x_m, double yaw_rad = 0.0) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translation().x() = x_m;
  T.linear() = Eigen::AngleAxisd(yaw_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  return T;
}

TEST(MountGate, PassesAMountThatStaysWhereItIs) {
  MountGate gate{{}};
  for (int k = 0; k < 100; ++k) {
    EXPECT_FALSE(gate.check("mbes", mountAt(1.0 + 1e-4 * (k % 10), 1e-4 * (k % 7))).has_value());
    EXPECT_FALSE(gate.check("mbes_port", mountAt(-3.0, 0.5)).has_value());
  }
  EXPECT_EQ(gate.inUse("mbes").translation().x(), 1.0);
  EXPECT_EQ(gate.inUse("mbes_port").translation().x(), -3.0);
  EXPECT_TRUE(gate.findings().empty());
}

TEST(MountGate, RefusesWhatNoVehicleHas) {
  const auto problem = [](const Eigen::Isometry3d& T) {
    MountGate gate{{}};
    return reasonOf(gate.check("mbes", T));
  };
  EXPECT_EQ(problem(mountAt(50.0)), std::nullopt);
  EXPECT_EQ(problem(mountAt(1200.0)), Reason::kImplausibleMount);  // millimetres
  EXPECT_EQ(problem(mountAt(std::nan(""))), Reason::kImplausibleMount);
  Eigen::Isometry3d no_rotation = mountAt(1.0);
  no_rotation.linear() *= 2.0;
  EXPECT_EQ(problem(no_rotation), Reason::kImplausibleMount);
}

TEST(MountGate, UsesTheFirstPlausibleOne) {
  MountGate gate{{}};
  EXPECT_TRUE(gate.check("mbes", mountAt(1200.0)).has_value());
  EXPECT_FALSE(gate.check("mbes", mountAt(1.2)).has_value());
  EXPECT_FALSE(gate.check("mbes", mountAt(1200.0)).has_value());
  EXPECT_EQ(gate.inUse("mbes").translation().x(), 1.2);
}

TEST(MountGate, TellsOnceOfAMountThatChanges) {
  const auto findingsAfter = [](const Eigen::Isometry3d& later) {
    MountGate gate{{}};
    gate.check("mbes", mountAt(1.0, 0.2));
    for (int k = 0; k < 5; ++k) EXPECT_FALSE(gate.check("mbes", later).has_value());
    EXPECT_EQ(gate.inUse("mbes").translation().x(), 1.0);
    return gate.findings();
  };
  EXPECT_TRUE(findingsAfter(mountAt(1.019, 0.2)).empty());
  EXPECT_TRUE(findingsAfter(mountAt(1.0, 0.209)).empty());
  EXPECT_EQ(findingsAfter(mountAt(1.021, 0.2)).size(), 1U);
  const auto turned = findingsAfter(mountAt(1.0, 0.211));
  ASSERT_EQ(turned.size(), 1U);
  EXPECT_EQ(turned[0].name, "mount_changed");
  EXPECT_EQ(turned[0].severity, Severity::kWarning);
  EXPECT_NE(turned[0].text.find("turned by 0.011 rad"), std::string::npos) << turned[0].text;
}

// ---- fixes -------------------------------------------------------------------------------------

TEST(InputGateFixes, MayBeLateButNotOfAnotherClock) {
  const InputGate gate{GateParams()};
  EXPECT_FALSE(gate.checkFix(1000.0, 1060.0).has_value());
  EXPECT_FALSE(gate.checkFix(1000.0, 990.0).has_value());
  EXPECT_EQ(gate.checkFix(0.0, 1000.0)->reason(), Reason::kNoStamp);
  EXPECT_EQ(gate.checkFix(1011.0, 1000.0)->reason(), Reason::kClockAhead);
  EXPECT_EQ(gate.checkFix(1000.0, 4601.0)->reason(), Reason::kClockBehind);
}

}  // namespace
}  // namespace rbpf_core
