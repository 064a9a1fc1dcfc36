// Numbers as people read them, for what is said of inputs.
#pragma once

#include <cmath>
#include <cstdio>
#include <string>

namespace rbpf_core {

// With so many decimals; a number of absurd size in six digits and a power of ten.
inline std::string decimal(double value, int decimals) {
  if (std::abs(value) < 0.5 * std::pow(10.0, -decimals)) value = 0.0;  // never -0.0
  char text[40];
  if (std::abs(value) < 1e15) {
    std::snprintf(text, sizeof(text), "%.*f", decimals, value);
  } else {
    std::snprintf(text, sizeof(text), "%g", value);
  }
  return text;
}

}  // namespace rbpf_core
