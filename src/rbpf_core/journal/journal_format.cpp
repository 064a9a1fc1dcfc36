#include "rbpf_core/journal/journal_format.hpp"

#include <zlib.h>

#include <algorithm>

#include "rbpf_core/journal/change_bytes.hpp"

namespace rbpf_core::journal_format {

namespace {

template <typename T>
std::uint8_t* put(const T& number, std::uint8_t* to) {
  std::memcpy(to, &number, sizeof(T));
  return to + sizeof(T);
}

}  // namespace

std::vector<std::uint8_t> fileHead() {
  std::vector<std::uint8_t> head(kFileHeadBytes);
  put(kVersion, put(kMagic, head.data()));
  return head;
}

std::vector<std::uint8_t> toRecord(const Change& change) {
  const std::vector<std::uint8_t> content = toBytes(change);
  std::vector<std::uint8_t> record(kRecordHeadBytes + content.size() + kChecksumBytes);
  std::uint8_t* to = put(static_cast<std::uint32_t>(content.size()), record.data());
  to = put(static_cast<std::uint8_t>(change.index()), to);
  to = std::copy(content.begin(), content.end(), to);
  put(checksum(record.data(), record.size() - kChecksumBytes), to);
  return record;
}

std::uint32_t checksum(const std::uint8_t* bytes, std::size_t size) {
  return static_cast<std::uint32_t>(crc32_z(0, bytes, size));
}

}  // namespace rbpf_core::journal_format
