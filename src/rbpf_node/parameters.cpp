#include "rbpf_node/parameters.hpp"

#include <ros/names.h>

#include <cmath>

#include "rbpf_core/decimal.hpp"
#include "rbpf_node/parameter_reader.hpp"

namespace rbpf_node {

namespace {

// Beyond these a value is a slip, and would cost memory, time or the sense of a sum.
constexpr double kFarthest_m = 1e7;
constexpr double kLargestNoise_m = 100.0;  // of a vehicle's motion, per sqrt(s)
constexpr double kLongest_s = 1e10;
constexpr double kFastest_mps = 1e4;
constexpr double kFastestTurn_radps = 100.0;
constexpr double kWidest_rad = 2.0 * M_PI;
constexpr double kMost = 1e6;  // of what has no unit
// Of a registration, whose work grows with its square.
constexpr double kWidestSearch_m = 200.0;
constexpr double kLongestWindow_s = 600.0;
constexpr std::size_t kMostVertices = 10000;

std::vector<Eigen::Vector2d> surveyArea(ParameterReader& reader) {
  std::vector<Eigen::Vector2d> area;
  for (const auto& [x, y] : reader.points("survey_area")) area.emplace_back(x, y);
  if (area.size() < 3 || area.size() > kMostVertices) {
    ParameterReader::fail("survey_area", "a list of " + std::to_string(area.size()) + " points",
                          "a polygon [[x, y], ...] in map, m, of 3 to " +
                              std::to_string(kMostVertices) + " points: the seabed to be mapped");
  }
  return area;
}

// Centre of the survey area's bounding box: coordinates on the wire count from here.
rbpf_core::Origin originOf(const std::vector<Eigen::Vector2d>& area) {
  Eigen::Vector2d low = area.front();
  Eigen::Vector2d high = area.front();
  for (const Eigen::Vector2d& vertex : area) {
    low = low.cwiseMin(vertex);
    high = high.cwiseMax(vertex);
  }
  return {0.5 * (low.x() + high.x()), 0.5 * (low.y() + high.y())};
}

rbpf_core::OdometryParams odometry(ParameterReader& reader) {
  rbpf_core::OdometryParams params;
  const std::string velocity = reader.choice("odometry/velocity", {"auto", "pose", "twist"});
  params.velocity = velocity == "auto"   ? rbpf_core::Velocity::kAuto
                    : velocity == "pose" ? rbpf_core::Velocity::kPose
                                         : rbpf_core::Velocity::kTwist;
  params.gap_s = reader.number("odometry/gap_s", 0.0, kLongest_s);
  params.max_bridge_s = reader.number("odometry/max_bridge_s", params.gap_s, kLongest_s);
  return params;
}

rbpf_core::GateParams gate(ParameterReader& reader) {
  rbpf_core::GateParams params;
  params.odometry = odometry(reader);
  params.clock.max_ahead_s = reader.number("clock/max_ahead_s", 0.0, kLongest_s);
  params.clock.max_behind_s = reader.number("clock/max_behind_s", 0.0, kLongest_s);
  rbpf_core::PlausibilityParams& bounds = params.plausibility;
  bounds.max_speed_mps = reader.number("plausibility/max_speed_mps", 0.1, kFastest_mps);
  bounds.max_turn_rate_radps =
      reader.number("plausibility/max_turn_rate_radps", 0.01, kFastestTurn_radps);
  bounds.max_depth_m = reader.number("plausibility/max_depth_m", 1.0, kFarthest_m);
  bounds.max_lever_arm_m = reader.number("plausibility/max_lever_arm_m", 0.0, kFarthest_m);
  bounds.max_mount_shift_m = reader.number("plausibility/max_mount_shift_m", 0.0, kFarthest_m);
  bounds.max_mount_turn_rad = reader.number("plausibility/max_mount_turn_rad", 0.0, kWidest_rad);
  return params;
}

std::optional<rbpf_core::Pose2> startPose(ParameterReader& reader) {
  const std::vector<double> pose = reader.numbers("start/pose");
  if (pose.empty()) return std::nullopt;
  if (pose.size() != 3) {
    ParameterReader::fail("start/pose", "a list of " + std::to_string(pose.size()) + " numbers",
                          "[x, y, yaw] in m and rad, or []");
  }
  return rbpf_core::Pose2{pose[0], pose[1], pose[2]};
}

FixInputParams fixInput(ParameterReader& reader) {
  FixInputParams params;
  const std::vector<double> origin = reader.numbers("survey_origin");
  const bool is_place =
      origin.size() == 2 && std::abs(origin[0]) <= 90.0 && std::abs(origin[1]) <= 360.0;
  if (!origin.empty() && !is_place) {
    std::string written;
    for (const double number : origin) {
      written += (written.empty() ? "[" : ", ") + std::to_string(number);
    }
    ParameterReader::fail("survey_origin", written + "]",
                          "[latitude, longitude] in degrees within +-90 and +-360, or []");
  }
  if (is_place) params.survey_origin = Geographic{origin[0], origin[1]};
  params.std_m = reader.number("fixes/std_m", 0.001, kFarthest_m);
  return params;
}

rbpf_core::FixParams fixes(ParameterReader& reader) {
  rbpf_core::FixParams params;
  params.max_sigmas = reader.number("fixes/max_sigmas", 1.0, kMost);
  params.drift_mps = reader.number("fixes/drift_mps", 0.0, kFastest_mps);
  params.max_late_s = reader.number("fixes/max_late_s", 10.0, 120.0);
  params.max_std_m = reader.number("fixes/max_std_m", 0.1, kFarthest_m);
  return params;
}

rbpf_core::PingFilterParams pingFilter(ParameterReader& reader) {
  rbpf_core::PingFilterParams params;
  params.min_range_m = reader.number("pings/min_range_m", 0.0, kFarthest_m);
  params.max_range_m = reader.number("pings/max_range_m", params.min_range_m, kFarthest_m);
  params.outlier_window = static_cast<int>(reader.integer("pings/outlier_window", 0, 1001));
  if (params.outlier_window != 0 && (params.outlier_window % 2 == 0 || params.outlier_window < 3)) {
    ParameterReader::fail("pings/outlier_window", std::to_string(params.outlier_window),
                          "an odd number of beams from 3, or 0");
  }
  params.outlier_threshold = reader.number("pings/outlier_threshold", 1.0, kMost);
  return params;
}

rbpf_core::FilterParams filter(ParameterReader& reader) {
  rbpf_core::FilterParams params;
  params.particles =
      static_cast<std::size_t>(reader.integer("particles", 1, rbpf_core::kMostParticles));
  params.seed = static_cast<std::uint64_t>(reader.integer("seed", 0, 2147483647));
  params.start_pose = startPose(reader);
  params.start_position_std_m = reader.number("start/position_std_m", 0.0, kFarthest_m);
  params.start_yaw_std_rad = reader.number("start/yaw_std_rad", 0.0, kWidest_rad);
  params.motion.surge_std_m = reader.number("motion/surge_std_m", 0.0, kLargestNoise_m);
  params.motion.sway_std_m = reader.number("motion/sway_std_m", 0.0, kLargestNoise_m);
  params.motion.yaw_std_rad = reader.number("motion/yaw_std_rad", 0.0, kWidest_rad);
  params.pings = pingFilter(reader);
  params.fixes = fixes(reader);
  params.ping_queue = static_cast<std::size_t>(reader.integer("pings/queue", 1, 1000000));
  params.hold_back_s = reader.number("mapping/hold_back_s", 0.0, kLongest_s);
  params.common_random_numbers = reader.boolean("mapping/common_random_numbers");
  params.holdout = reader.number("evaluation/holdout", 0.0, 0.5);
  return params;
}

// Maps under one model, which they have from elsewhere, have no objective of their own.
double elboBeams(ParameterReader& reader) {
  const double beams = reader.number("lc/elbo_beams", 0.0, kMost);
  if (beams == 0.0) return 0.0;
  const std::string engine = reader.text("map/engine");
  const std::string optimizer = engine == "svgp" ? reader.text("svgp/optimizer") : "none";
  if (optimizer != "adam" && optimizer != "natgrad") {
    ParameterReader::fail("lc/elbo_beams", rbpf_core::decimal(beams, 1),
                          "0 unless map/engine is svgp, here " + engine +
                              ", and svgp/optimizer is adam or natgrad, here " + optimizer +
                              ": other maps have no ELBO each of its own");
  }
  return beams;
}

rbpf_core::WeightingParams loopClosure(ParameterReader& reader) {
  rbpf_core::WeightingParams params;
  params.rule = reader.choice("lc/weights", {"product", "robust"}) == "product"
                    ? rbpf_core::WeightRule::kProduct
                    : rbpf_core::WeightRule::kRobust;
  params.noise_std_m = reader.number("lc/noise_std_m", 1e-3, kFarthest_m);
  params.tempering = reader.number("lc/tempering", 0.0, 1.0);
  params.elbo_beams = elboBeams(reader);
  params.min_n_eff_share = reader.number("lc/min_n_eff_share", 0.0, 1.0);
  params.effective_beams = reader.number("lc/effective_beams", 0.0, kMost);
  params.student_t_dof = reader.number("lc/student_t_dof", 1.0, kMost);
  params.min_overlap = reader.number("lc/min_overlap", 1e-3, 1.0);
  params.mapped_variance = reader.number("lc/mapped_variance", 0.0, 2.0);
  params.veto_sigma = reader.number("lc/veto_sigma", 0.0, kMost);
  return params;
}

rbpf_core::smoothing::PastSmoothingParams smoothing(ParameterReader& reader) {
  rbpf_core::smoothing::PastSmoothingParams params;
  params.period_s = reader.number("smoothing/period_s", 0.0, kLongest_s);
  params.min_change_m = reader.number("smoothing/min_change_m", 0.0, kFarthest_m);
  params.map_tolerance_m = reader.number("smoothing/map_tolerance_m", 0.0, kFarthest_m);
  rbpf_core::smoothing::SmoothingParams& smoothing = params.smoothing;
  smoothing.velocity_bias_std_mps =
      reader.number("smoothing/velocity_bias_std_mps", 0.0, kFastest_mps);
  smoothing.yaw_bias_std_radps =
      reader.number("smoothing/yaw_bias_std_radps", 0.0, kFastestTurn_radps);
  smoothing.current_std_mps = reader.number("smoothing/current_std_mps", 0.0, kFastest_mps);
  smoothing.bias_time_s = reader.number("smoothing/bias_time_s", 1.0, kLongest_s);
  rbpf_core::smoothing::RegistrationParams& registration = smoothing.registration;
  registration.window_s = reader.number("smoothing/window_s", 1.0, kLongestWindow_s);
  registration.map_window_s =
      reader.number("smoothing/map_window_s", registration.window_s, kLongestWindow_s);
  registration.min_apart_s =
      reader.number("smoothing/min_apart_s", 2.0 * registration.map_window_s, kLongest_s);
  registration.passes = static_cast<int>(reader.integer("smoothing/passes", 1, 100));
  registration.effective_beams = reader.number("smoothing/effective_beams", 1.0, kMost);
  registration.max_search_m = reader.number("smoothing/max_search_m", 1.0, kWidestSearch_m);
  return params;
}

// What cannot be right together.
void expectAgreement(const Parameters& params) {
  const auto& [map, odom, base] = params.frames;
  if (map == odom || map == base || odom == base) {
    ParameterReader::fail("frames", "map: " + map + ", odom: " + odom + ", base: " + base,
                          "three frames that differ");
  }
  if (params.nodes > params.filter.particles) {
    ParameterReader::fail(
        "nodes", std::to_string(params.nodes),
        "at most one for each of the " + std::to_string(params.filter.particles) + " particles");
  }
  // Every prompt would be tempered until nothing is left to resample, and so would all after it.
  if (params.loop_closure.rule == rbpf_core::WeightRule::kRobust &&
      params.resampling_threshold > 0.0 &&
      params.loop_closure.min_n_eff_share >= params.resampling_threshold) {
    ParameterReader::fail(
        "lc/min_n_eff_share", std::to_string(params.loop_closure.min_n_eff_share),
        "a number below resampling/threshold, " + std::to_string(params.resampling_threshold));
  }
}

}  // namespace

Parameters validParameters(const XmlRpc::XmlRpcValue& tree) {
  ParameterReader reader(tree);
  Parameters params;
  params.nodes = static_cast<std::size_t>(reader.integer("nodes", 1, 1000));
  params.frames = {withoutSlash(reader.text("frames/map")),
                   withoutSlash(reader.text("frames/odom")),
                   withoutSlash(reader.text("frames/base"))};
  params.survey_area_m = surveyArea(reader);
  params.fix_input = fixInput(reader);
  params.gate = gate(reader);
  params.filter = filter(reader);
  params.filter.odometry = params.gate.odometry;
  params.filter.origin = originOf(params.survey_area_m);
  params.loop_closure = loopClosure(reader);
  params.loop_closure_rate_hz = reader.number("lc/rate_hz", 0.0, 100.0);
  params.loop_closure_timeout_s = reader.number("lc/timeout_s", 0.1, kLongest_s);
  params.resampling_threshold = reader.number("resampling/threshold", 0.0, 1.0);
  params.resampling_timeout_s = reader.number("resampling/timeout_s", 0.1, kLongest_s);
  params.smoothing = smoothing(reader);
  params.offline_steps_per_second = reader.number("offline/steps_per_second", 0.0, kMost);
  params.publish_rate_hz = reader.number("output/publish_rate_hz", 0.01, 100.0);
  params.bathymetry_voxel_m = reader.number("output/bathymetry_voxel_m", 0.01, kFarthest_m);
  params.vehicle_length_m = reader.number("output/vehicle_length_m", 0.1, kFarthest_m);
  params.final_training_s = reader.number("output/final_training_s", 0.0, kLongest_s);
  // for the recorder alone
  reader.boolean("output/figures");
  reader.number("output/time_lapse_period_s", 0.0, kLongest_s);
  reader.integer("survey_epsg", 0, 999999);
  expectAgreement(params);
  // config/default.yaml has the groups of all engines, whichever is chosen
  reader.refuseUnknown({"map", "svgp", "gmrf", reader.text("map/engine")});
  return params;
}

OfflineParameters validOfflineParameters(const XmlRpc::XmlRpcValue& tree) {
  ParameterReader reader(tree);
  if (!reader.boolean("~take_turns")) {
    ParameterReader::fail("~take_turns", "false",
                          "true before the map nodes start, as in offline.launch: they would not "
                          "wait for the replay");
  }
  return {reader.text("~bag"),
          {reader.text("~odom_topic"), reader.text("~ping_topic"), reader.text("~fix_topic")},
          reader.boolean("~recorded")};
}

namespace {

XmlRpc::XmlRpcValue treeOf(const ros::NodeHandle& node) {
  XmlRpc::XmlRpcValue tree;
  if (!node.getParam("rbpf_svgp_slam", tree)) {
    ParameterReader::fail(node.resolveName("rbpf_svgp_slam"), "missing",
                          "config/default.yaml to be loaded there");
  }
  return tree;
}

}  // namespace

Parameters loadParameters(const ros::NodeHandle& node) { return validParameters(treeOf(node)); }

std::string parametersAsXml(const ros::NodeHandle& node) { return treeOf(node).toXml(); }

OfflineParameters loadOfflineParameters(const ros::NodeHandle& private_node) {
  XmlRpc::XmlRpcValue tree;
  tree["~bag"] = std::string();
  tree["~odom_topic"] = std::string("/odom");
  tree["~ping_topic"] = std::string("/mbes/pings");
  tree["~fix_topic"] = std::string("/fixes");
  tree["~recorded"] = false;
  tree["~take_turns"] = false;
  for (auto& [name, value] : tree) private_node.getParam(name.substr(1), value);
  OfflineParameters offline = validOfflineParameters(tree);
  // in the node's namespace, as subscribers have them
  for (std::string* topic :
       {&offline.topics.odometry, &offline.topics.pings, &offline.topics.fixes}) {
    *topic = ros::names::resolve(*topic);
  }
  return offline;
}

}  // namespace rbpf_node
