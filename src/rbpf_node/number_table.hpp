// Rows of numbers under named columns, for numpy to read.
#pragma once

#include <string>
#include <vector>

namespace rbpf_node {

class NumberTable {
 public:
  explicit NumberTable(std::vector<std::string> columns) : columns_(std::move(columns)) {}

  // Throws std::logic_error unless there is one number a column.
  void add(const std::vector<double>& row);

  const std::vector<std::string>& columns() const { return columns_; }
  std::size_t rows() const { return numbers_.size() / columns_.size(); }

  // As an array [rows, columns] of float64 in numpy's format (npy, version 1.0). Throws
  // std::runtime_error that names the file if it cannot be written.
  void write(const std::string& path) const;

 private:
  std::vector<std::string> columns_;
  std::vector<double> numbers_;
};

}  // namespace rbpf_node
