#include "rbpf_core/journal/filter_settings.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>

namespace rbpf_core {

namespace {

// Params: const for who writes them.
template <typename Params, typename Visit>
void forEach(Params& params, const Visit& visit) {
  visit("particles", params.particles);
  visit("seed", params.seed);
  visit("start/pose", params.start_pose);
  visit("start/position_std_m", params.start_position_std_m);
  visit("start/yaw_std_rad", params.start_yaw_std_rad);
  visit("odometry/velocity", params.odometry.velocity);
  visit("odometry/gap_s", params.odometry.gap_s);
  visit("odometry/max_bridge_s", params.odometry.max_bridge_s);
  visit("motion/surge_std_m", params.motion.surge_std_m);
  visit("motion/sway_std_m", params.motion.sway_std_m);
  visit("motion/yaw_std_rad", params.motion.yaw_std_rad);
  visit("pings/min_range_m", params.pings.min_range_m);
  visit("pings/max_range_m", params.pings.max_range_m);
  visit("pings/outlier_window", params.pings.outlier_window);
  visit("pings/outlier_threshold", params.pings.outlier_threshold);
  visit("pings/queue", params.ping_queue);
  visit("fixes/max_sigmas", params.fixes.max_sigmas);
  visit("fixes/drift_mps", params.fixes.drift_mps);
  visit("fixes/max_late_s", params.fixes.max_late_s);
  visit("fixes/max_std_m", params.fixes.max_std_m);
  visit("mapping/hold_back_s", params.hold_back_s);
  visit("mapping/common_random_numbers", params.common_random_numbers);
  visit("evaluation/holdout", params.holdout);
  // the survey area's centre, from which maps have their coordinates
  visit("survey_area/centre_x_m", params.origin.x_m);
  visit("survey_area/centre_y_m", params.origin.y_m);
}

// ---- values as text, and back ----------------------------------------------------------------

// In the enumeration's order.
constexpr std::array<const char*, 3> kVelocities = {"twist", "pose", "auto"};

struct Write {
  std::ostream& out;

  template <typename T>
  void operator()(const char* name, const T& value) const {
    out << name << ' ';
    put(value);
    out << '\n';
  }

 private:
  template <typename T>
  void put(const T& number) const {
    out << number;
  }
  // As short as it can be to be read back as it is.
  void put(double number) const {
    std::array<char, 32> text{};
    const auto end = std::to_chars(text.data(), text.data() + text.size(), number).ptr;
    out.write(text.data(), end - text.data());
  }
  void put(bool value) const { out << (value ? "true" : "false"); }
  void put(Velocity velocity) const { out << kVelocities[static_cast<std::size_t>(velocity)]; }
  void put(const std::optional<Pose2>& pose) const {
    if (pose) {
      put(pose->x_m);
      out << ' ';
      put(pose->y_m);
      out << ' ';
      put(pose->yaw_rad);
    } else {
      out << "none";
    }
  }
};

struct Read {
  const std::map<std::string, std::string>& values;

  template <typename T>
  void operator()(const char* name, T& value) const {
    const auto found = values.find(name);
    const std::string text = found == values.end() ? "missing" : found->second;
    std::istringstream in(text);
    take(in, value);
    if (!in) throw std::runtime_error(std::string(name) + " is " + text + ", expected a value");
  }

 private:
  template <typename T>
  static void take(std::istream& in, T& number) {
    in >> number;
  }
  static void take(std::istream& in, bool& value) { in >> std::boolalpha >> value; }
  static void take(std::istream& in, Velocity& velocity) {
    std::string name;
    in >> name;
    const auto* const found = std::find(kVelocities.begin(), kVelocities.end(), name);
    velocity = static_cast<Velocity>(found - kVelocities.begin());
    if (found == kVelocities.end()) in.setstate(std::ios::failbit);
  }
  static void take(std::istringstream& in, std::optional<Pose2>& pose) {
    if (in.str() == "none") return;
    in >> pose.emplace().x_m >> pose->y_m >> pose->yaw_rad;
  }
};

std::map<std::string, std::string> valuesOf(const FilterSettings& settings) {
  std::map<std::string, std::string> values;
  std::istringstream lines(settings.text);
  for (std::string line; std::getline(lines, line);) {
    const std::size_t space = line.find(' ');
    if (space != std::string::npos) values[line.substr(0, space)] = line.substr(space + 1);
  }
  return values;
}

}  // namespace

FilterSettings settingsOf(const FilterParams& params) {
  std::ostringstream text;
  forEach(params, Write{text});
  return {text.str()};
}

FilterParams paramsOf(const FilterSettings& settings) {
  FilterParams params;
  const std::map<std::string, std::string> values = valuesOf(settings);
  forEach(params, Read{values});
  if (params.particles < 1 || params.particles > kMostParticles) {
    throw std::runtime_error("particles is " + values.at("particles") + ", expected 1 to " +
                             std::to_string(kMostParticles));
  }
  return params;
}

void expectSameSettings(const FilterSettings& before, const FilterSettings& now) {
  const std::map<std::string, std::string> had = valuesOf(before);
  std::map<std::string, std::string> have = valuesOf(now);
  std::string differences;
  const auto differ = [&](const std::string& name, const std::string& is, const std::string& was) {
    differences += (differences.empty() ? "" : "; ") + name + " is " + is + ", expected " + was;
  };
  for (const auto& [name, value] : had) {
    const auto found = have.find(name);
    const std::string is = found == have.end() ? "unknown" : found->second;
    if (is != value) differ(name, is, value);
    have.erase(name);
  }
  for (const auto& [name, value] : have) differ(name, value, "none of that name");
  if (!differences.empty()) {
    throw std::runtime_error("the survey has begun with other parameters: " + differences);
  }
}

}  // namespace rbpf_core
