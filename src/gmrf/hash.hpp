// A 64-bit hash of bytes, to recognise equal tiles and damaged files; no defence against malice.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

namespace gmrf {

// Multiplication and shifts as in the finaliser of MurmurHash3, eight bytes at a time.
inline std::uint64_t hashOf(const void* data, std::size_t size) {
  const auto mix = [](std::uint64_t h) {
    h ^= h >> 33;
    h *= 0xff51afd7ed558ccdULL;
    h ^= h >> 33;
    h *= 0xc4ceb9fe1a85ec53ULL;
    return h ^ (h >> 33);
  };
  const char* bytes = static_cast<const char*>(data);
  std::uint64_t hash = mix(size);
  for (; size >= 8; size -= 8, bytes += 8) {
    std::uint64_t word;
    std::memcpy(&word, bytes, 8);
    hash = mix(hash ^ word) + 0x9e3779b97f4a7c15ULL;
  }
  std::uint64_t rest = 0;
  std::memcpy(&rest, bytes, size);
  return mix(hash ^ rest);
}

}  // namespace gmrf
