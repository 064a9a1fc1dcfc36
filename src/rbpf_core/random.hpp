// Random streams. Every particle and every minibatch draws from a stream of its own that is a
// function of the seed alone, so that results do not depend on threads or on who asks first.
#pragma once

#include <cstdint>
#include <initializer_list>

namespace rbpf_core {

// SplitMix64 (Steele, Lea, Flood 2014): 8 bytes of state, passes BigCrush, a
// UniformRandomBitGenerator.
class RandomStream {
 public:
  using result_type = std::uint64_t;

  explicit RandomStream(std::uint64_t state = 0) : state_(state) {}

  static constexpr result_type min() { return 0; }
  static constexpr result_type max() { return ~result_type{0}; }

  result_type operator()() {
    state_ += 0x9E3779B97F4A7C15ULL;
    return mix(state_);
  }

  // Uniform in 0 .. n-1, by multiplication (Lemire 2019); its bias of n / 2^64 is far below
  // anything seen here.
  std::uint64_t below(std::uint64_t n) {
    __extension__ using Wide = unsigned __int128;  // both GCC and Clang, on every 64-bit machine
    return static_cast<std::uint64_t>((static_cast<Wide>((*this)()) * n) >> 64);
  }

  // Uniform in [0, 1).
  double uniform() { return static_cast<double>((*this)() >> 11) * 0x1.0p-53; }

  static std::uint64_t mix(std::uint64_t z) {
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ULL;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBULL;
    return z ^ (z >> 31);
  }

 private:
  std::uint64_t state_;
};

// What a stream is for: streams of different purposes never meet.
enum class StreamPurpose : std::uint64_t { kStart = 1, kMotion, kMinibatch, kResampling };

// The stream of one purpose, particle (or 0) and call number.
inline RandomStream makeStream(std::uint64_t seed, StreamPurpose purpose, std::uint64_t particle,
                               std::uint64_t call = 0) {
  std::uint64_t state = RandomStream::mix(seed + 0x9E3779B97F4A7C15ULL);
  for (const std::uint64_t part : {static_cast<std::uint64_t>(purpose), particle, call}) {
    state = RandomStream::mix(state ^ (part + 0xD1B54A32D192ED03ULL));
  }
  return RandomStream(state);
}

}  // namespace rbpf_core
