#include "rbpf_node/door.hpp"

#include <utility>

namespace rbpf_node {

void Door::takeIn(InputKind kind, const RawMessage& message) {
  try {
    std::visit([this](auto&& input) { slam_.handle(std::move(input)); }, readInput(kind, message));
  } catch (const Refusal& refusal) {
    slam_.refuse(kind, refusal.reason(), refusal.what());
  } catch (const std::exception& error) {
    slam_.refuse(kind, Reason::kMalformed, error.what());
  }
}

}  // namespace rbpf_node
