// A message as it comes from a topic or a bag. The first byte: of which type.
#include "../node/message_of_bytes.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace rbpf_node;
  static const std::vector<WholeMessage> kMessages = wholeMessages();
  if (size == 0) return 0;
  const WholeMessage& like = kMessages[data[0] % kMessages.size()];
  isRead(like.kind, {like.raw.datatype, like.raw.md5sum, {data + 1, data + size}});
  return 0;
}
