// An array that only grows, and never moves what it holds.
#pragma once

#include <cstddef>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

namespace rbpf_core {

// One thread appends while any number of threads read. Without any lock, a reader may read all
// elements below a size that the writer has published (under a mutex, say).
template <typename T, std::size_t kBlockElements>
class AppendOnly {
 public:
  void push_back(const T& element) {
    const std::size_t block = size_ / kBlockElements;
    if (block == blocks_.size()) {
      throw std::length_error("more than " + std::to_string(size_) + " elements");
    }
    // for_overwrite would do, but is C++20
    if (!blocks_[block]) blocks_[block].reset(new T[kBlockElements]);
    blocks_[block][size_ % kBlockElements] = element;
    ++size_;
  }

  const T& operator[](std::size_t i) const {
    return blocks_[i / kBlockElements][i % kBlockElements];
  }

  std::size_t size() const { return size_; }  // for the writer only

 private:
  static constexpr std::size_t kMostBlocks = std::size_t{1} << 15;

  // as long as it will ever be: one that grew would move while it is read
  std::vector<std::unique_ptr<T[]>> blocks_ = std::vector<std::unique_ptr<T[]>>(kMostBlocks);
  std::size_t size_ = 0;
};

}  // namespace rbpf_core
