#include "rbpf_node/parameter_reader.hpp"

#include <cmath>
#include <sstream>
#include <stdexcept>

#include "rbpf_node/nearest_name.hpp"

namespace rbpf_node {

namespace {

using XmlRpc::XmlRpcValue;

std::string written(const XmlRpcValue& value) {
  std::ostringstream out;
  out << value;
  return out.str();
}

// Numbers may be written without a decimal point.
bool asNumber(XmlRpcValue& value, double* number) {
  if (value.getType() == XmlRpcValue::TypeInt) {
    *number = static_cast<int>(value);
  } else if (value.getType() == XmlRpcValue::TypeDouble) {
    *number = static_cast<double>(value);
  } else {
    return false;
  }
  return std::isfinite(*number);
}

}  // namespace

ParameterReader::ParameterReader(const XmlRpcValue& tree) : tree_(tree) {}

void ParameterReader::fail(const std::string& name, const std::string& value,
                           const std::string& expected) {
  throw std::invalid_argument("parameter " + name + " is " + value + ", expected " + expected);
}

XmlRpcValue& ParameterReader::find(const std::string& name) {
  known_.insert(name);
  XmlRpcValue* value = &tree_;
  std::istringstream parts(name);
  for (std::string part; std::getline(parts, part, '/');) {
    if (value->getType() != XmlRpcValue::TypeStruct || !value->hasMember(part)) {
      fail(name, "missing", "config/default.yaml to be loaded before any overlay");
    }
    value = &(*value)[part];
  }
  return *value;
}

double ParameterReader::number(const std::string& name, double min, double max) {
  XmlRpcValue& value = find(name);
  double number = 0.0;
  if (!asNumber(value, &number) || number < min || number > max) {
    std::ostringstream expected;
    expected << "a finite number from " << min << " to " << max;
    fail(name, written(value), expected.str());
  }
  return number;
}

std::int64_t ParameterReader::integer(const std::string& name, std::int64_t min, std::int64_t max) {
  XmlRpcValue& value = find(name);
  const bool is_integer = value.getType() == XmlRpcValue::TypeInt;
  const std::int64_t number = is_integer ? static_cast<int>(value) : 0;
  if (!is_integer || number < min || number > max) {
    fail(name, written(value),
         "an integer from " + std::to_string(min) + " to " + std::to_string(max));
  }
  return number;
}

bool ParameterReader::boolean(const std::string& name) {
  XmlRpcValue& value = find(name);
  if (value.getType() != XmlRpcValue::TypeBoolean) fail(name, written(value), "true or false");
  return static_cast<bool&>(value);
}

std::string ParameterReader::text(const std::string& name) {
  XmlRpcValue& value = find(name);
  if (value.getType() != XmlRpcValue::TypeString || static_cast<std::string&>(value).empty()) {
    fail(name, written(value), "a text that is not empty");
  }
  return static_cast<std::string&>(value);
}

std::string ParameterReader::choice(const std::string& name, const std::set<std::string>& choices) {
  const std::string chosen = text(name);
  if (choices.count(chosen) == 0) {
    std::string expected = "one of";
    for (const std::string& choice : choices) expected += " " + choice;
    fail(name, chosen, expected);
  }
  return chosen;
}

std::vector<double> ParameterReader::numbers(const std::string& name) {
  XmlRpcValue& value = find(name);
  if (value.getType() != XmlRpcValue::TypeArray) fail(name, written(value), "a list of numbers");
  std::vector<double> numbers;
  for (int i = 0; i < value.size(); ++i) {
    numbers.push_back(0.0);
    if (!asNumber(value[i], &numbers.back())) fail(name, written(value), "finite numbers");
  }
  return numbers;
}

std::vector<std::pair<double, double>> ParameterReader::points(const std::string& name) {
  XmlRpcValue& value = find(name);
  if (value.getType() != XmlRpcValue::TypeArray) fail(name, written(value), "a list of [x, y]");
  std::vector<std::pair<double, double>> points;
  for (int i = 0; i < value.size(); ++i) {
    double x = 0.0;
    double y = 0.0;
    if (value[i].getType() != XmlRpcValue::TypeArray || value[i].size() != 2 ||
        !asNumber(value[i][0], &x) || !asNumber(value[i][1], &y)) {
      fail(name, written(value), "pairs [x, y] of finite numbers");
    }
    points.emplace_back(x, y);
  }
  return points;
}

void ParameterReader::refuseUnknown(const std::set<std::string>& foreign_groups) const {
  collectUnknown(tree_, "", foreign_groups);
}

void ParameterReader::collectUnknown(const XmlRpcValue& tree, const std::string& prefix,
                                     const std::set<std::string>& foreign_groups) const {
  XmlRpcValue copy = tree;
  for (auto& [key, value] : copy) {
    const std::string name = prefix + key;
    if (foreign_groups.count(name) != 0) continue;
    if (value.getType() == XmlRpcValue::TypeStruct) {
      collectUnknown(value, name + "/", foreign_groups);
    } else if (known_.count(name) == 0) {
      const std::string meant = likelyMeant(name, foreign_groups);
      fail(name, written(value),
           "no such parameter" + (meant.empty() ? "" : ": did you mean " + meant + "?") +
               " (config/default.yaml lists them all)");
    }
  }
}

std::string ParameterReader::likelyMeant(const std::string& name,
                                         const std::set<std::string>& foreign_groups) const {
  std::set<std::string> names = known_;
  // names in foreign groups are not known here, but a mistyped group is
  const std::size_t slash = name.find('/');
  if (slash != std::string::npos) {
    const std::string group = nearestName(name.substr(0, slash), foreign_groups);
    if (!group.empty()) names.insert(group + name.substr(slash));
  }
  return nearestName(name, names);
}

}  // namespace rbpf_node
