// A yaml file as rosparam lays it on the parameter server.
#pragma once

#include <XmlRpcValue.h>
#include <yaml-cpp/yaml.h>

#include <string>

namespace rbpf_node {

inline XmlRpc::XmlRpcValue scalarOf(const YAML::Node& node) {
  int integer = 0;
  double number = 0.0;
  bool truth = false;
  const bool quoted = node.Tag() == "!";
  if (!quoted && YAML::convert<int>::decode(node, integer)) return XmlRpc::XmlRpcValue(integer);
  if (!quoted && YAML::convert<double>::decode(node, number)) return XmlRpc::XmlRpcValue(number);
  if (!quoted && YAML::convert<bool>::decode(node, truth)) return XmlRpc::XmlRpcValue(truth);
  return XmlRpc::XmlRpcValue(node.Scalar());
}

inline XmlRpc::XmlRpcValue treeOf(const YAML::Node& node) {
  if (node.IsScalar()) return scalarOf(node);
  XmlRpc::XmlRpcValue tree;
  if (node.IsSequence()) {
    tree.setSize(static_cast<int>(node.size()));
    for (std::size_t i = 0; i < node.size(); ++i) tree[static_cast<int>(i)] = treeOf(node[i]);
  } else {
    for (const auto& entry : node) tree[entry.first.Scalar()] = treeOf(entry.second);
  }
  return tree;
}

}  // namespace rbpf_node
