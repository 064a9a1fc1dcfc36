#include "rbpf_node/bag_topics.hpp"

namespace rbpf_node {

namespace {

std::string withoutSlashes(const std::string& name) {
  const std::size_t first = name.find_first_not_of('/');
  if (first == std::string::npos) return "";
  return name.substr(first, name.find_last_not_of('/') - first + 1);
}

}  // namespace

std::string topicInBag(const std::string& name, const std::set<std::string>& topics) {
  for (std::string rest = withoutSlashes(name); !rest.empty();) {
    for (const std::string& topic : topics) {
      if (withoutSlashes(topic) == rest) return topic;
    }
    const std::size_t slash = rest.find('/');
    rest = slash == std::string::npos ? "" : rest.substr(slash + 1);
  }
  return "";
}

}  // namespace rbpf_node
