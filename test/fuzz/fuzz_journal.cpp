// A journal to be resumed. The first byte: 0 as it is, otherwise with the right checksums, which
// no fuzzer finds.
#include <sys/mman.h>
#include <unistd.h>

#include "../core/journal_of_bytes.hpp"

namespace {

// In memory, and of a name.
class MemoryFile {
 public:
  const std::string path() const { return "/proc/self/fd/" + std::to_string(file_); }
  void hold(const std::vector<std::uint8_t>& bytes) const {
    const auto size = static_cast<off_t>(bytes.size());
    const bool done =
        ftruncate(file_, 0) == 0 && pwrite(file_, bytes.data(), bytes.size(), 0) == size;
    promise(done, "memory takes the bytes");
  }

 private:
  const int file_ = memfd_create("journal", 0);
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const MemoryFile kFile;
  if (size == 0) return 0;
  const std::vector<std::uint8_t> bytes(data + 1, data + size);
  kFile.hold(data[0] == 0 ? bytes : rbpf_core::withRightChecksums(bytes));
  rbpf_core::isResumed(kFile.path());
  return 0;
}
