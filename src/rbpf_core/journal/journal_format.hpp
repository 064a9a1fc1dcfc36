// The file: kMagic, the version, and then records, one after the other, little endian:
//   uint32 bytes of the change · uint8 its type, Change::index() · the change, toBytes ·
//   uint32 CRC-32 of all of that
// Records are never changed. A file of another version is refused, so that whoever changes what a
// record consists of, or what the filter makes of it, raises kVersion.
#pragma once

#include <array>
#include <cstdint>
#include <cstring>
#include <vector>

#include "rbpf_core/change.hpp"

namespace rbpf_core::journal_format {

constexpr std::array<char, 8> kMagic = {'R', 'B', 'P', 'F', 'J', 'R', 'N', 'L'};
constexpr std::uint32_t kVersion = 4;
constexpr std::size_t kFileHeadBytes = kMagic.size() + sizeof(kVersion);
constexpr std::size_t kRecordHeadBytes = 5;
constexpr std::size_t kChecksumBytes = 4;
// A ping of 80 million beams; more is damage.
constexpr std::uint32_t kMostBytes = 1'000'000'000;

std::vector<std::uint8_t> fileHead();
std::vector<std::uint8_t> toRecord(const Change& change);
std::uint32_t checksum(const std::uint8_t* bytes, std::size_t size);

template <typename T>
T numberAt(const std::uint8_t* bytes) {
  T number;
  std::memcpy(&number, bytes, sizeof(T));
  return number;
}

}  // namespace rbpf_core::journal_format
