// A map of the engine gmrf, from another node or from a file. The first byte: 0 as it is, otherwise
// with the right hashes, which no fuzzer finds.
#include "../gmrf/map_of_bytes.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  std::string bytes(data + 1, data + size);
  gmrf::isMap(data[0] == 0 ? bytes : gmrf::withRightHashes(std::move(bytes)));
  return 0;
}
