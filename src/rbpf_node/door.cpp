#include "rbpf_node/door.hpp"

#include <utility>

namespace rbpf_node {

void Door::takeIn(InputKind kind, const RawMessage& message) {
  try {
    std::visit([this](auto&& input) { slam_.handle(std::move(input)); }, readInput(kind, message));
  } catch (const std::exception& error) {
    slam_.refuse(kind, error.what());
  }
}

}  // namespace rbpf_node
