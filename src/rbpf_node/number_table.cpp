#include "rbpf_node/number_table.hpp"

#include <cstdint>
#include <fstream>
#include <stdexcept>

namespace rbpf_node {

void NumberTable::add(const std::vector<double>& row) {
  if (row.size() != columns_.size()) {
    throw std::logic_error("a row of " + std::to_string(row.size()) + " numbers, expected " +
                           std::to_string(columns_.size()));
  }
  numbers_.insert(numbers_.end(), row.begin(), row.end());
}

void NumberTable::write(const std::string& path) const {
  static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "the header says so");
  std::string header = "{'descr': '<f8', 'fortran_order': False, 'shape': (" +
                       std::to_string(rows()) + ", " + std::to_string(columns_.size()) + "), }";
  // magic, version, the header's length and the header: a multiple of 64 bytes
  constexpr std::size_t kBefore = 10;
  header.resize((kBefore + header.size() + 1 + 63) / 64 * 64 - kBefore, ' ');
  header.back() = '\n';
  const auto length = static_cast<std::uint16_t>(header.size());
  std::ofstream file(path, std::ios::binary);
  file.write("\x93NUMPY\x01\x00", 8);
  file.write(reinterpret_cast<const char*>(&length), sizeof(length));
  file << header;
  file.write(reinterpret_cast<const char*>(numbers_.data()),
             static_cast<std::streamsize>(numbers_.size() * sizeof(double)));
  file.close();
  if (!file) throw std::runtime_error(path + " cannot be written");
}

}  // namespace rbpf_node
