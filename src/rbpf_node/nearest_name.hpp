// What somebody may have meant who has mistyped a name.
#pragma once

#include <set>
#include <string>

namespace rbpf_node {

// Characters to be inserted, deleted or replaced to make b of a (Levenshtein's distance).
std::size_t editDistance(const std::string& a, const std::string& b);

// The name that is most like a mistyped one, or, for a right name in a wrong group, the name with
// the same last part. Empty if none is more like it than unlike.
std::string nearestName(const std::string& mistyped, const std::set<std::string>& names);

}  // namespace rbpf_node
