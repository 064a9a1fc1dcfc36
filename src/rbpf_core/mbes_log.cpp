#include "rbpf_core/mbes_log.hpp"

namespace rbpf_core {

void MbesLog::append(PoseSlot slot, const Beams& levelled_m) {
  for (Eigen::Index i = 0; i < levelled_m.cols(); ++i) {
    beams_.push_back({levelled_m(0, i), levelled_m(1, i), levelled_m(2, i), slot});
  }
}

}  // namespace rbpf_core
