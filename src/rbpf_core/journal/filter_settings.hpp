// A filter's parameters as text, and whether a survey can go on under others.
#pragma once

#include <string>

#include "rbpf_core/change.hpp"
#include "rbpf_core/filter_params.hpp"

namespace rbpf_core {

// Numbers are written so that they are read back as they are. Names are those of
// config/default.yaml.
FilterSettings settingsOf(const FilterParams& params);

// The other way round. Throws std::runtime_error that names a parameter that is missing, no
// value, or more particles than there can be.
FilterParams paramsOf(const FilterSettings& settings);

// Throws std::runtime_error that names every parameter that differs, and both values: what the
// filter has done so far was done with the first ones.
void expectSameSettings(const FilterSettings& before, const FilterSettings& now);

}  // namespace rbpf_core
