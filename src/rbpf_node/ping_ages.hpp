// How old pings are when they enter the log.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

namespace rbpf_node {

// A histogram over the logarithm of the age: as large after a day as after a minute.
class PingAges {
 public:
  void add(double age_s) {
    const double bin = std::log(std::max(age_s, kLeast_s) / kLeast_s) / std::log(kRatio);
    ++counts_[std::min(static_cast<std::size_t>(bin), counts_.size() - 1)];
    ++pings_;
    largest_s_ = std::max(largest_s_, age_s);
  }

  // The age, s, that a share of all pings, 0 .. 1, did not exceed; up to 2 % too large, NaN before
  // the first ping.
  double quantile(double share) const {
    if (pings_ == 0) return std::numeric_limits<double>::quiet_NaN();
    const auto wanted = static_cast<std::uint64_t>(std::ceil(share * static_cast<double>(pings_)));
    std::uint64_t below = 0;
    for (std::size_t bin = 0; bin < counts_.size(); ++bin) {
      below += counts_[bin];
      if (below == 0 || below < wanted) continue;
      const double end_s = kLeast_s * std::pow(kRatio, static_cast<double>(bin + 1));
      if (bin + 1 < counts_.size()) return std::min(end_s, largest_s_);
    }
    return largest_s_;
  }

 private:
  static constexpr double kLeast_s = 1e-5;
  static constexpr double kRatio = 1.02;  // of the ends of a bin

  std::array<std::uint64_t, 1000> counts_{};  // up to an hour
  std::uint64_t pings_ = 0;
  double largest_s_ = -std::numeric_limits<double>::infinity();
};

}  // namespace rbpf_node
