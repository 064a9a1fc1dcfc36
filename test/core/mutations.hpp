// Bytes that were whole, damaged in the ways of disks, wires and strangers: the same ones for the
// same seed. RBPF_FUZZ_S seconds of them in place of a test's own share: tools/fuzz.sh.
#pragma once

#include <algorithm>
#include <cstdint>
#include <random>
#include <vector>

namespace rbpf_core {

class Mutations {
 public:
  explicit Mutations(std::uint32_t seed) : random_(seed) {}

  std::size_t below(std::size_t end) {
    return end == 0 ? 0 : std::uniform_int_distribution<std::size_t>(0, end - 1)(random_);
  }

  // One to four of them.
  std::vector<std::uint8_t> of(std::vector<std::uint8_t> bytes) {
    for (std::size_t left = 1 + below(4); left > 0 && !bytes.empty(); --left) mutate(&bytes);
    return bytes;
  }

 private:
  void mutate(std::vector<std::uint8_t>* bytes) {
    static const std::vector<std::uint32_t> kTelling = {
        0, 1, 0x7f, 0x7fffffff, 0x80000000, 0xffffffff, 0x7f800000, 0x7fc00000, 0xff7fffff};
    const std::size_t at = below(bytes->size());
    switch (below(6)) {
      case 0:
        (*bytes)[at] = static_cast<std::uint8_t>((*bytes)[at] ^ (1U << below(8)));
        break;
      case 1:
        (*bytes)[at] = static_cast<std::uint8_t>(below(256));
        break;
      case 2:  // a length, a number
        for (std::size_t i = 0; i < 4 && at + i < bytes->size(); ++i) {
          (*bytes)[at + i] =
              static_cast<std::uint8_t>(kTelling[below(kTelling.size())] >> (8 * (i % 4)));
        }
        break;
      case 3:  // cut
        bytes->resize(at);
        break;
      case 4: {  // something is missing
        const std::size_t count = std::min(1 + below(64), bytes->size() - at);
        const auto first = bytes->begin() + static_cast<std::ptrdiff_t>(at);
        bytes->erase(first, first + static_cast<std::ptrdiff_t>(count));
        break;
      }
      default: {  // something has come twice
        const std::size_t count = std::min(1 + below(64), bytes->size() - at);
        const auto first = bytes->begin() + static_cast<std::ptrdiff_t>(at);
        const std::vector<std::uint8_t> twice(first, first + static_cast<std::ptrdiff_t>(count));
        bytes->insert(first, twice.begin(), twice.end());
      }
    }
  }

  std::mt19937 random_;
};

}  // namespace rbpf_core
