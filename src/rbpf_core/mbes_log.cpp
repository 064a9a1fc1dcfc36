#include "rbpf_core/mbes_log.hpp"

namespace rbpf_core {

void MbesLog::append(std::uint32_t ping, const Beams& levelled_m) {
  for (Eigen::Index i = 0; i < levelled_m.cols(); ++i) {
    // for_overwrite would do, but is C++20
    if (size_ == blocks_.size() * kBlockBeams) blocks_.emplace_back(new LoggedBeam[kBlockBeams]);
    blocks_.back()[size_ % kBlockBeams] = {levelled_m(0, i), levelled_m(1, i), levelled_m(2, i),
                                           ping};
    ++size_;
  }
}

}  // namespace rbpf_core
