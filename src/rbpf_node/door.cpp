#include "rbpf_node/door.hpp"

#include <utility>

namespace rbpf_node {

void Door::takeIn(rbpf_core::InputKind kind, const RawMessage& message, double receipt_s) {
  try {
    std::visit([&](auto&& input) { slam_.handle(std::move(input), receipt_s); },
               readInput(kind, message));
  } catch (const rbpf_core::Refusal& refusal) {
    slam_.intake().refuse(kind, refusal.reason(), refusal.what());
  } catch (const std::exception& error) {
    slam_.intake().refuse(kind, rbpf_core::Reason::kMalformed, error.what());
  }
}

}  // namespace rbpf_node
