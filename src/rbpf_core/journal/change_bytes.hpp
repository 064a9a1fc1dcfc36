// A change as bytes, little endian.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "rbpf_core/change.hpp"

namespace rbpf_core {

std::vector<std::uint8_t> toBytes(const Change& change);

// type: Change::index(). Throws std::invalid_argument if there is no such type, or if the bytes
// are not what it takes.
Change toChange(std::size_t type, const std::vector<std::uint8_t>& bytes);

}  // namespace rbpf_core
