#include "rbpf_node/nearest_name.hpp"

#include <algorithm>
#include <numeric>
#include <vector>

namespace rbpf_node {

namespace {

std::string lastPart(const std::string& name) { return name.substr(name.rfind('/') + 1); }

std::size_t distanceOfNames(const std::string& a, const std::string& b) {
  const std::size_t whole = editDistance(a, b);
  // another group counts as much as one character
  return lastPart(a) == lastPart(b) ? std::min<std::size_t>(whole, 1) : whole;
}

}  // namespace

std::size_t editDistance(const std::string& a, const std::string& b) {
  // distances of the part of a that has been read from every beginning of b
  std::vector<std::size_t> distance(b.size() + 1);
  std::iota(distance.begin(), distance.end(), 0);
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = distance[0];
    distance[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = distance[j];
      distance[j] = std::min({replaced, distance[j] + 1, distance[j - 1] + 1});
    }
  }
  return distance[b.size()];
}

std::string nearestName(const std::string& mistyped, const std::set<std::string>& names) {
  std::string nearest;
  std::size_t smallest = mistyped.size() / 2 + 1;
  for (const std::string& name : names) {
    const std::size_t distance = distanceOfNames(mistyped, name);
    if (distance >= smallest) continue;
    smallest = distance;
    nearest = name;
  }
  return nearest;
}

}  // namespace rbpf_node
