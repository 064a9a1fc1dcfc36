// Reads a journal up to its end, or to where it is damaged.
#pragma once

#include <cstdint>
#include <fstream>
#include <optional>
#include <string>
#include <vector>

#include "rbpf_core/change.hpp"

namespace rbpf_core {

// What comes after the last record that can be used.
struct LostTail {
  std::uint64_t bytes = 0;
  // Known to be lost: the damaged one, and whole ones after it, which mean nothing without it.
  std::size_t records = 0;
  std::string why;
};

class JournalReader {
 public:
  // Throws std::runtime_error that names the file if it cannot be read, or is no journal of this
  // version.
  explicit JournalReader(const std::string& path);

  // The next record; none at the end.
  std::optional<Change> next();

  // Up to the end of the last record that was read.
  std::uint64_t wholeBytes() const { return whole_bytes_; }
  // After the end has been reached; none: the file ends with a whole record.
  const std::optional<LostTail>& lostTail() const { return lost_tail_; }

 private:
  struct Record {
    std::size_t type;
    std::vector<std::uint8_t> content;
    std::string problem;
    // Whether its length can be believed.
    bool has_end = false;
  };
  Record read();
  void endAt(const Record& damaged);

  std::ifstream file_;
  std::uint64_t file_bytes_ = 0;
  // Where the next record begins.
  std::uint64_t at_ = 0;
  std::uint64_t whole_bytes_ = 0;
  std::optional<LostTail> lost_tail_;
};

}  // namespace rbpf_core
