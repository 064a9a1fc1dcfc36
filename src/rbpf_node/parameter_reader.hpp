// Checked access to a tree of parameters.
#pragma once

#include <XmlRpcValue.h>

#include <cstdint>
#include <limits>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace rbpf_node {

class ParameterReader {
 public:
  explicit ParameterReader(const XmlRpc::XmlRpcValue& tree);

  // Each throws std::invalid_argument: name, value, what was expected.
  double number(const std::string& name, double min, double max);
  std::int64_t integer(const std::string& name, std::int64_t min, std::int64_t max);
  bool boolean(const std::string& name);
  std::string text(const std::string& name);
  std::string choice(const std::string& name, const std::set<std::string>& choices);
  std::vector<double> numbers(const std::string& name);
  std::vector<std::pair<double, double>> points(const std::string& name);

  // Throws if the tree holds a name that nobody asked for, outside the groups given. The error says
  // which name may have been meant.
  void refuseUnknown(const std::set<std::string>& foreign_groups) const;

  [[noreturn]] static void fail(const std::string& name, const std::string& value,
                                const std::string& expected);

 private:
  XmlRpc::XmlRpcValue& find(const std::string& name);
  void collectUnknown(const XmlRpc::XmlRpcValue& tree, const std::string& prefix,
                      const std::set<std::string>& foreign_groups) const;
  std::string likelyMeant(const std::string& name,
                          const std::set<std::string>& foreign_groups) const;

  // XmlRpcValue has no const access
  mutable XmlRpc::XmlRpcValue tree_;
  std::set<std::string> known_;
};

}  // namespace rbpf_node
