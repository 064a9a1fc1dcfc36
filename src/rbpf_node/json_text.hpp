// JSON, as far as facts about a bag need it: each function returns a value as text.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace rbpf_node::json {

// Bytes beyond ASCII are written as if they were Latin-1: names in a bag may be anything.
std::string text(const std::string& value);
// null for what is not finite
std::string number(double value);
std::string boolean(bool value);
std::string list(const std::vector<std::string>& values);
std::string texts(const std::vector<std::string>& values);
std::string numbers(const std::vector<double>& values);
// Names, and values that are JSON already.
std::string object(const std::vector<std::pair<std::string, std::string>>& members);

}  // namespace rbpf_node::json
