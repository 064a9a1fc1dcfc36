#include "rbpf_node/door.hpp"

#include <utility>

#include "rbpf_node/inputs/from_pose_with_covariance.hpp"

namespace rbpf_node {

void Door::takeIn(rbpf_core::InputKind kind, const RawMessage& message, double receipt_s) {
  attempt(kind, [&] {
    std::visit([&](auto&& input) { slam_.handle(std::move(input), receipt_s); },
               readInput(kind, message));
  });
}

void Door::takeInitialPose(const geometry_msgs::PoseWithCovarianceStamped& message,
                           double receipt_s) {
  attempt(rbpf_core::InputKind::kFix, [&] { slam_.handle(fromInitialPose(message), receipt_s); });
}

template <typename Take>
void Door::attempt(rbpf_core::InputKind kind, const Take& take) {
  try {
    take();
  } catch (const rbpf_core::Refusal& refusal) {
    slam_.intake().refuse(kind, refusal.reason(), refusal.what());
  } catch (const std::exception& error) {
    slam_.intake().refuse(kind, rbpf_core::Reason::kMalformed, error.what());
  }
}

}  // namespace rbpf_node
