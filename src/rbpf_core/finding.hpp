// What is wrong with a survey as a whole, rather than with one of its messages.
#pragma once

#include <string>

namespace rbpf_core {

enum class Severity { kWarning, kError };

struct Finding {
  // For machines: "twist_against_pose".
  std::string name;
  Severity severity = Severity::kWarning;
  // The figures that disagree, and the likely cause.
  std::string text;
};

}  // namespace rbpf_core
