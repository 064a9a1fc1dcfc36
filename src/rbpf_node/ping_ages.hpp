// How old pings are when they enter the log.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace rbpf_node {

class PingAges {
 public:
  void add(double age_s) { ages_s_.push_back(static_cast<float>(age_s)); }

  // The age, s, that a share of all pings, 0 .. 1, did not exceed; NaN before the first.
  double quantile(double share) const {
    if (ages_s_.empty()) return std::numeric_limits<double>::quiet_NaN();
    std::vector<float> ages_s = ages_s_;
    const auto last = static_cast<double>(ages_s.size() - 1);
    const auto place = ages_s.begin() + static_cast<std::ptrdiff_t>(std::ceil(share * last));
    std::nth_element(ages_s.begin(), place, ages_s.end());
    return *place;
  }

 private:
  std::vector<float> ages_s_;  // of the whole run: 4 bytes a ping
};

}  // namespace rbpf_node
