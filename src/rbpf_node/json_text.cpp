#include "rbpf_node/json_text.hpp"

#include <cmath>
#include <cstdio>

namespace rbpf_node::json {

namespace {

// All values between two brackets.
template <typename Values, typename Write>
std::string joined(const char* open, const Values& values, const char* close, Write write) {
  std::string result = open;
  for (const auto& value : values) {
    if (result.size() > 1) result += ", ";
    result += write(value);
  }
  return result + close;
}

}  // namespace

std::string text(const std::string& value) {
  std::string result = "\"";
  for (const char character : value) {
    const auto byte = static_cast<unsigned char>(character);
    if (character == '"' || character == '\\') {
      result += {'\\', character};
    } else if (byte >= 0x20 && byte < 0x7f) {
      result += character;
    } else {
      char escaped[8];
      std::snprintf(escaped, sizeof(escaped), "\\u%04x", byte);
      result += escaped;
    }
  }
  return result + "\"";
}

std::string number(double value) {
  if (!std::isfinite(value)) return "null";
  char result[32];
  std::snprintf(result, sizeof(result), "%.17g", value);
  return result;
}

std::string boolean(bool value) { return value ? "true" : "false"; }

std::string list(const std::vector<std::string>& values) {
  return joined("[", values, "]", [](const std::string& value) { return value; });
}

std::string texts(const std::vector<std::string>& values) { return joined("[", values, "]", text); }

std::string numbers(const std::vector<double>& values) { return joined("[", values, "]", number); }

std::string object(const std::vector<std::pair<std::string, std::string>>& members) {
  return joined("{", members, "}",
                [](const auto& member) { return text(member.first) + ": " + member.second; });
}

}  // namespace rbpf_node::json
