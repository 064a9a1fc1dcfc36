#include "rbpf_core/journal/journal_reader.hpp"

#include <algorithm>
#include <array>
#include <stdexcept>

#include "rbpf_core/journal/change_bytes.hpp"
#include "rbpf_core/journal/journal_format.hpp"

namespace rbpf_core {

using namespace journal_format;

JournalReader::JournalReader(const std::string& path) : file_(path, std::ios::binary) {
  if (!file_) throw std::runtime_error("journal " + path + " cannot be read");
  file_.seekg(0, std::ios::end);
  file_bytes_ = static_cast<std::uint64_t>(file_.tellg());
  file_.seekg(0);
  std::array<char, kFileHeadBytes> head{};
  if (!file_.read(head.data(), head.size())) {
    throw std::runtime_error(path + " is no journal: it has " + std::to_string(file_bytes_) +
                             " bytes, expected at least " + std::to_string(kFileHeadBytes));
  }
  if (!std::equal(kMagic.begin(), kMagic.end(), head.begin())) {
    throw std::runtime_error(path + " is no journal: it does not begin with " +
                             std::string(kMagic.begin(), kMagic.end()));
  }
  const auto* bytes = reinterpret_cast<const std::uint8_t*>(head.data());
  const auto version = numberAt<std::uint32_t>(bytes + kMagic.size());
  if (version != kVersion) {
    throw std::runtime_error("journal " + path + " is of format version " +
                             std::to_string(version) + ", expected " + std::to_string(kVersion));
  }
  at_ = whole_bytes_ = kFileHeadBytes;
}

std::optional<Change> JournalReader::next() {
  if (lost_tail_ || at_ == file_bytes_) return std::nullopt;
  Record record = read();
  if (record.problem.empty()) {
    try {
      Change change = toChange(record.type, record.content);
      whole_bytes_ = at_;
      return change;
    } catch (const std::invalid_argument& error) {
      record.problem = std::string("a record of ") + error.what();
    }
  }
  endAt(record);
  return std::nullopt;
}

JournalReader::Record JournalReader::read() {
  Record record{};
  const std::uint64_t left = file_bytes_ - at_;
  std::array<std::uint8_t, kRecordHeadBytes> head;
  if (left < head.size()) {
    record.problem = "the file ends within a record";
    return record;
  }
  const auto read = [&](std::uint8_t* bytes, std::size_t size) {
    file_.read(reinterpret_cast<char*>(bytes), static_cast<std::streamsize>(size));
  };
  read(head.data(), head.size());
  const auto size = numberAt<std::uint32_t>(head.data());
  record.type = head[4];
  if (size > kMostBytes || size + kChecksumBytes > left - head.size()) {
    record.problem = "the file ends within a record, or its length is damaged";
    return record;
  }
  // as the checksum has it: the head, the content
  record.content.resize(head.size() + size);
  std::copy(head.begin(), head.end(), record.content.begin());
  read(record.content.data() + head.size(), size);
  std::array<std::uint8_t, kChecksumBytes> sum;
  read(sum.data(), sum.size());
  if (!file_) {
    record.problem = "the file cannot be read further";
    return record;
  }
  record.has_end = true;
  at_ += head.size() + size + sum.size();
  if (checksum(record.content.data(), record.content.size()) !=
      numberAt<std::uint32_t>(sum.data())) {
    record.problem = "a record's checksum does not agree";
  }
  record.content.erase(record.content.begin(),
                       record.content.begin() + static_cast<std::ptrdiff_t>(head.size()));
  return record;
}

void JournalReader::endAt(const Record& damaged) {
  LostTail tail{file_bytes_ - whole_bytes_, 1, damaged.problem};
  for (bool goes_on = damaged.has_end; goes_on && at_ < file_bytes_;) {
    const Record record = read();
    goes_on = record.problem.empty();
    if (goes_on) ++tail.records;
  }
  lost_tail_ = std::move(tail);
}

}  // namespace rbpf_core
