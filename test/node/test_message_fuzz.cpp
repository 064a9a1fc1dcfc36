// Whatever the bytes of a message are, it is read or refused, and takes no more memory than its
// bytes are worth.
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <vector>

#include "../core/mutations.hpp"
#include "message_of_bytes.hpp"

namespace rbpf_node {
namespace {

using rbpf_core::InputKind;

double peakMb() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) * 1024.0 / 1e6;
}

TEST(FuzzedMessages, AreReadOrRefused) {
  const std::vector<WholeMessage> kinds = wholeMessages();
  const double before_mb = peakMb();
  std::vector<std::size_t> read(kinds.size());
  std::vector<std::size_t> refused(kinds.size());
  for (std::uint32_t seed = 0; seed < 60000; ++seed) {
    rbpf_core::Mutations mutations(seed);
    const std::size_t k = seed % kinds.size();
    RawMessage raw = kinds[k].raw;
    raw.bytes = mutations.of(raw.bytes);
    ++(isRead(kinds[k].kind, raw) ? read : refused)[k];
  }
  for (std::size_t k = 0; k < kinds.size(); ++k) {
    EXPECT_GT(refused[k], 1000U) << kinds[k].raw.datatype;
    if (kinds[k].kind == InputKind::kFix) continue;  // of zeros: no covariance, no frame
    EXPECT_GT(read[k], 500U) << kinds[k].raw.datatype;
  }
  EXPECT_LT(peakMb() - before_mb, 20.0);
}

// A length in place of each of a message's numbers.
TEST(FuzzedMessages, ThatAnnounceGigabytesAreGivenNone) {
  const double before_mb = peakMb();
  for (const WholeMessage& kind : wholeMessages()) {
    for (std::size_t at = 0; at + 4 <= kind.raw.bytes.size(); ++at) {
      for (const std::uint8_t high : {0x00, 0x0f, 0x3f, 0x7f, 0xff}) {
        RawMessage raw = kind.raw;
        for (std::size_t i = 0; i < 3; ++i) raw.bytes[at + i] = 0xff;
        raw.bytes[at + 3] = high;
        isRead(kind.kind, raw);
      }
    }
  }
  EXPECT_LT(peakMb() - before_mb, 20.0);
}

}  // namespace
}  // namespace rbpf_node
