// config/default.yaml is the one source of defaults: it is read, and nothing differs from it.
#include <gtest/gtest.h>

#include <cmath>
#include <sstream>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "error_of.hpp"
#include "rbpf_node/parameters.hpp"
#include "yaml_tree.hpp"

namespace rbpf_node {
namespace {

using XmlRpc::XmlRpcValue;

// A survey area about the origin, so that it leaves the origin of coordinates at its default.
XmlRpcValue defaultTree() {
  XmlRpcValue tree = treeOf(YAML::LoadFile(RBPF_CONFIG "/default.yaml"));
  tree["survey_area"] = treeOf(YAML::Load("[[-10, -5], [10, -5], [10, 5], [-10, 5]]"));
  return tree;
}

XmlRpcValue treeWith(const std::string& group, const std::string& name, const XmlRpcValue& value) {
  XmlRpcValue tree = defaultTree();
  tree[group][name] = value;
  return tree;
}

std::string refusalOf(const XmlRpcValue& tree) {
  return errorOf([&] { validParameters(tree); });
}

// ---- every field of the parameters, by name ----------------------------------------------------

using Fields = std::vector<std::pair<std::string, std::string>>;

template <typename Value>
std::string text(const Value& value) {
  std::ostringstream out;
  out.precision(17);
  if constexpr (std::is_enum_v<Value>) {
    out << static_cast<int>(value);
  } else {
    out << value;
  }
  return out.str();
}

std::string text(const std::optional<rbpf_core::Pose2>& pose) {
  return pose ? text(pose->x_m) + " " + text(pose->y_m) + " " + text(pose->yaw_rad) : "none";
}

void append(const std::string& group, const Fields& fields, Fields* all) {
  for (const auto& [name, value] : fields) all->emplace_back(group + "." + name, value);
}

#define FIELD(name) \
  { #name, text(name) }

// A structured binding names every member: this file does not compile if one is missing.

Fields fieldsOf(const rbpf_core::MotionNoise& noise) {
  const auto& [surge_std_m, sway_std_m, yaw_std_rad] = noise;
  return {FIELD(surge_std_m), FIELD(sway_std_m), FIELD(yaw_std_rad)};
}

Fields fieldsOf(const rbpf_core::PingFilterParams& params) {
  const auto& [min_range_m, max_range_m, outlier_window, outlier_threshold] = params;
  return {FIELD(min_range_m), FIELD(max_range_m), FIELD(outlier_window), FIELD(outlier_threshold)};
}

Fields fieldsOf(const rbpf_core::FixParams& params) {
  const auto& [max_sigmas, drift_mps, max_late_s, max_std_m] = params;
  return {FIELD(max_sigmas), FIELD(drift_mps), FIELD(max_late_s), FIELD(max_std_m)};
}

Fields fieldsOf(const FixInputParams& params) {
  const auto& [survey_origin, std_m] = params;
  return {{"survey_origin", survey_origin ? "set" : "none"}, FIELD(std_m)};
}

Fields fieldsOf(const rbpf_core::Origin& origin) {
  const auto& [x_m, y_m] = origin;
  return {FIELD(x_m), FIELD(y_m)};
}

Fields fieldsOf(const rbpf_core::OdometryParams& params) {
  const auto& [velocity, gap_s, max_bridge_s] = params;
  return {FIELD(velocity), FIELD(gap_s), FIELD(max_bridge_s)};
}

Fields fieldsOf(const rbpf_core::GateParams& params) {
  const auto& [clock, plausibility, odometry] = params;
  const auto& [max_ahead_s, max_behind_s] = clock;
  const auto& [max_speed_mps, max_turn_rate_radps, max_depth_m, max_lever_arm_m, max_mount_shift_m,
               max_mount_turn_rad] = plausibility;
  Fields fields = {FIELD(max_ahead_s),         FIELD(max_behind_s),      FIELD(max_speed_mps),
                   FIELD(max_turn_rate_radps), FIELD(max_depth_m),       FIELD(max_lever_arm_m),
                   FIELD(max_mount_shift_m),   FIELD(max_mount_turn_rad)};
  append("odometry", fieldsOf(odometry), &fields);
  return fields;
}

Fields fieldsOf(const rbpf_core::FilterParams& params) {
  const auto& [particles, seed, start_pose, start_position_std_m, start_yaw_std_rad, odometry,
               motion, pings, fixes, ping_queue, hold_back_s, holdout, common_random_numbers,
               origin] = params;
  Fields fields = {FIELD(particles),
                   FIELD(seed),
                   FIELD(start_pose),
                   FIELD(start_position_std_m),
                   FIELD(start_yaw_std_rad),
                   FIELD(ping_queue),
                   FIELD(hold_back_s),
                   FIELD(holdout),
                   FIELD(common_random_numbers)};
  append("odometry", fieldsOf(odometry), &fields);
  append("motion", fieldsOf(motion), &fields);
  append("pings", fieldsOf(pings), &fields);
  append("fixes", fieldsOf(fixes), &fields);
  append("origin", fieldsOf(origin), &fields);
  return fields;
}

Fields fieldsOf(const rbpf_core::WeightingParams& params) {
  const auto& [rule, noise_std_m, tempering, elbo_beams, min_n_eff_share, effective_beams,
               student_t_dof, min_overlap, mapped_variance, veto_sigma] = params;
  return {FIELD(rule),          FIELD(noise_std_m),     FIELD(tempering),
          FIELD(elbo_beams),    FIELD(min_n_eff_share), FIELD(effective_beams),
          FIELD(student_t_dof), FIELD(min_overlap),     FIELD(mapped_variance),
          FIELD(veto_sigma)};
}

Fields fieldsOf(const Frames& frames) {
  const auto& [map, odom, base] = frames;
  return {FIELD(map), FIELD(odom), FIELD(base)};
}

Fields fieldsOf(const rbpf_core::smoothing::PastSmoothingParams& params) {
  const auto& [period_s, min_change_m, map_tolerance_m, smoothing] = params;
  const auto& [velocity_bias_std_mps, yaw_bias_std_radps, current_std_mps, bias_time_s] =
      std::tie(smoothing.velocity_bias_std_mps, smoothing.yaw_bias_std_radps,
               smoothing.current_std_mps, smoothing.bias_time_s);
  const auto& [node_period_s, window_s, map_window_s, min_apart_s, passes, effective_beams,
               max_search_m] = smoothing.registration;
  return {FIELD(period_s),
          FIELD(min_change_m),
          FIELD(map_tolerance_m),
          FIELD(bias_time_s),
          FIELD(velocity_bias_std_mps),
          FIELD(yaw_bias_std_radps),
          FIELD(current_std_mps),
          FIELD(window_s),
          FIELD(node_period_s),
          FIELD(map_window_s),
          FIELD(min_apart_s),
          FIELD(passes),
          FIELD(effective_beams),
          FIELD(max_search_m)};
}

Fields fieldsOf(const Parameters& params) {
  const auto& [nodes, frames, survey_area_m, fix_input, gate, filter, loop_closure,
               loop_closure_rate_hz, loop_closure_timeout_s, resampling_threshold,
               resampling_timeout_s, smoothing, offline_steps_per_second, final_training_s,
               publish_rate_hz, bathymetry_voxel_m, vehicle_length_m] = params;
  Fields fields = {FIELD(nodes),
                   FIELD(loop_closure_rate_hz),
                   FIELD(loop_closure_timeout_s),
                   FIELD(resampling_threshold),
                   FIELD(resampling_timeout_s),
                   FIELD(offline_steps_per_second),
                   FIELD(final_training_s),
                   FIELD(publish_rate_hz),
                   FIELD(bathymetry_voxel_m),
                   FIELD(vehicle_length_m)};
  append("frames", fieldsOf(frames), &fields);
  append("fix_input", fieldsOf(fix_input), &fields);
  append("gate", fieldsOf(gate), &fields);
  append("filter", fieldsOf(filter), &fields);
  append("loop_closure", fieldsOf(loop_closure), &fields);
  append("smoothing", fieldsOf(smoothing), &fields);
  return fields;
}

#undef FIELD

TEST(Defaults, AreThoseOfTheShippedFile) {
  const Fields shipped = fieldsOf(validParameters(defaultTree()));
  const Fields constructed = fieldsOf(Parameters());
  ASSERT_EQ(shipped.size(), constructed.size());
  for (std::size_t i = 0; i < shipped.size(); ++i) {
    EXPECT_EQ(shipped[i].second, constructed[i].second)
        << shipped[i].first << ": config/default.yaml and the struct's own default differ";
  }
}

// ---- what else the tree says -------------------------------------------------------------------

TEST(ValidParameters, WantASurveyArea) {
  const XmlRpcValue tree = treeOf(YAML::LoadFile(RBPF_CONFIG "/default.yaml"));
  EXPECT_TRUE(contains(refusalOf(tree), "survey_area is a list of 0 points, expected a polygon"));
}

TEST(ValidParameters, TakeTheSurveysOriginAsLatitudeAndLongitude) {
  XmlRpcValue tree = defaultTree();
  tree["survey_origin"] = treeOf(YAML::Load("[57.5, 11]"));
  const auto origin = validParameters(tree).fix_input.survey_origin;
  ASSERT_TRUE(origin.has_value());
  EXPECT_EQ(origin->latitude_deg, 57.5);
  EXPECT_EQ(origin->longitude_deg, 11.0);
  for (const char* wrong : {"[57.5]", "[97.5, 11.0]", "[1, 2, 3]"}) {
    tree["survey_origin"] = treeOf(YAML::Load(wrong));
    EXPECT_TRUE(contains(refusalOf(tree), "expected [latitude, longitude] in degrees")) << wrong;
  }
}

TEST(ValidParameters, TakeAnEpsgCodeForTheProductsOfTheSurvey) {
  XmlRpcValue tree = defaultTree();
  tree["survey_epsg"] = 32632;
  EXPECT_EQ(refusalOf(tree), "");
  tree["survey_epsg"] = -1;
  EXPECT_TRUE(contains(refusalOf(tree), "survey_epsg is -1, expected an integer"));
}

TEST(ValidParameters, CountCoordinatesFromTheMiddleOfTheSurveyArea) {
  XmlRpcValue tree = defaultTree();
  tree["survey_area"] = treeOf(YAML::Load("[[100, 0], [140, 0.0], [120, 30]]"));
  const rbpf_core::Origin origin = validParameters(tree).filter.origin;
  EXPECT_EQ(origin.x_m, 120.0);
  EXPECT_EQ(origin.y_m, 15.0);
}

TEST(ValidParameters, TellWhichNameMayHaveBeenMeant) {
  EXPECT_TRUE(contains(refusalOf(treeWith("lc", "rate_hx", 0.5)),
                       "parameter lc/rate_hx is 0.5, expected no such parameter: did you mean "
                       "lc/rate_hz?"));
  EXPECT_TRUE(contains(refusalOf(treeWith("svpg", "kernel", std::string("matern12"))),
                       "did you mean svgp/kernel?"));
  const std::string error = refusalOf(treeWith("sauna", "temperature_celsius", 90));
  EXPECT_TRUE(contains(error, "sauna/temperature_celsius is 90, expected no such parameter ("))
      << error;
}

TEST(ValidParameters, LeaveTheEnginesGroupToTheMapNodes) {
  XmlRpcValue tree = treeWith("sauna", "spacing_m", 2.0);
  EXPECT_TRUE(contains(refusalOf(tree), "sauna/spacing_m is 2, expected no such parameter"));
  tree["map"]["engine"] = std::string("sauna");
  EXPECT_EQ(refusalOf(tree), "");
}

TEST(ValidParameters, UseTheElboOfMapsThatAreTrainedEachByItself) {
  XmlRpcValue tree = treeWith("lc", "elbo_beams", 2.0);
  EXPECT_TRUE(contains(refusalOf(tree), "lc/elbo_beams is 2.0, expected 0 unless"));
  tree["svgp"]["optimizer"] = std::string("natgrad");
  EXPECT_EQ(refusalOf(tree), "");
  EXPECT_EQ(validParameters(tree).loop_closure.elbo_beams, 2.0);
  tree["map"]["engine"] = std::string("gmrf");
  EXPECT_TRUE(contains(refusalOf(tree), "here gmrf"));
}

TEST(ValidParameters, MustAgreeWithOneAnother) {
  EXPECT_TRUE(contains(refusalOf(treeWith("lc", "min_n_eff_share", 0.5)),
                       "expected a number below resampling/threshold"));
  XmlRpcValue tree = defaultTree();
  tree["nodes"] = 41;
  EXPECT_TRUE(contains(refusalOf(tree), "at most one for each of the 40 particles"));
}

TEST(ValidParameters, RefuseFramesOfOneName) {
  EXPECT_TRUE(contains(refusalOf(treeWith("frames", "odom", std::string("/map"))),
                       "frames is map: map, odom: map, base: base_link, expected three frames that "
                       "differ"));
}

TEST(ValidParameters, RefuseAPolygonOfTooManyVertices) {
  XmlRpcValue tree = defaultTree();
  tree["survey_area"].setSize(10001);
  for (int i = 0; i < 10001; ++i) {
    tree["survey_area"][i][0] = std::cos(2e-4 * M_PI * i);
    tree["survey_area"][i][1] = std::sin(2e-4 * M_PI * i);
  }
  EXPECT_TRUE(contains(refusalOf(tree),
                       "survey_area is a list of 10001 points, expected a polygon "
                       "[[x, y], ...] in map, m, of 3 to 10000 points"));
}

// Names of the numbers in the tree, but for the groups of the map nodes.
void collectNumbers(XmlRpcValue& tree, const std::string& prefix, std::vector<std::string>* names) {
  for (auto& [key, value] : tree) {
    const std::string name = prefix + key;
    if (name == "map" || name == "svgp" || name == "gmrf") continue;
    if (value.getType() == XmlRpcValue::TypeStruct) collectNumbers(value, name + "/", names);
    if (value.getType() == XmlRpcValue::TypeInt || value.getType() == XmlRpcValue::TypeDouble) {
      names->push_back(name);
    }
  }
}

TEST(ValidParameters, HaveALimitEach) {
  XmlRpcValue defaults = defaultTree();
  std::vector<std::string> names;
  collectNumbers(defaults, "", &names);
  ASSERT_GT(names.size(), 40U);
  for (const std::string& name : names) {
    XmlRpcValue tree = defaultTree();
    XmlRpcValue* value = &tree;
    std::istringstream parts(name);
    for (std::string part; std::getline(parts, part, '/');) value = &(*value)[part];
    *value = 1e30;
    const std::string error = refusalOf(tree);
    EXPECT_TRUE(contains(error, "parameter " + name + " is ")) << name << ": " << error;
    EXPECT_TRUE(contains(error, " to ")) << name << ": " << error;
  }
}

// ---- of an offline replay ----------------------------------------------------------------------

XmlRpcValue offlineTree() {
  XmlRpcValue tree;
  tree["~bag"] = std::string("survey.bag");
  tree["~odom_topic"] = std::string("/odom");
  tree["~ping_topic"] = std::string("/mbes/pings");
  tree["~fix_topic"] = std::string("/fixes");
  tree["~recorded"] = true;
  tree["~take_turns"] = true;
  return tree;
}

TEST(ValidOfflineParameters, AreTheBagAndItsTopics) {
  const OfflineParameters params = validOfflineParameters(offlineTree());
  EXPECT_EQ(params.bag, "survey.bag");
  EXPECT_EQ(params.topics.odometry, "/odom");
  EXPECT_EQ(params.topics.pings, "/mbes/pings");
  EXPECT_EQ(params.topics.fixes, "/fixes");
  EXPECT_TRUE(params.is_recorded);
}

TEST(ValidOfflineParameters, WantTurnsToBeTaken) {
  XmlRpcValue tree = offlineTree();
  tree["~take_turns"] = false;
  EXPECT_TRUE(contains(errorOf([&] { validOfflineParameters(tree); }),
                       "parameter ~take_turns is false, expected true before the map nodes start"));
}

TEST(ValidOfflineParameters, WantABag) {
  XmlRpcValue tree = offlineTree();
  tree["~bag"] = std::string();
  EXPECT_TRUE(contains(errorOf([&] { validOfflineParameters(tree); }),
                       "parameter ~bag is , expected a text that is not empty"));
}

}  // namespace
}  // namespace rbpf_node
