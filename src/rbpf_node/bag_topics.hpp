// Which topic of a bag is meant by a name that a user gives.
#pragma once

#include <set>
#include <string>

namespace rbpf_node {

// The bag's own name of a topic that is given with or without its leading slash or namespace:
// /auv/odom finds /auv/odom, auv/odom or, where a namespace has been put before it, /odom; the
// longest name that fits counts. An empty string if there is none. As bags/topics.py.
std::string topicInBag(const std::string& name, const std::set<std::string>& topics);

}  // namespace rbpf_node
