#include "rbpf_node/inputs/message_types.hpp"

#include <functional>
#include <vector>

#include "rbpf_node/inputs/from_laser_scan.hpp"
#include "rbpf_node/inputs/from_nav_sat_fix.hpp"
#include "rbpf_node/inputs/from_odometry.hpp"
#include "rbpf_node/inputs/from_point_cloud2.hpp"
#include "rbpf_node/inputs/from_pose_with_covariance.hpp"

namespace rbpf_node {

namespace {

struct MessageType {
  rbpf_core::InputKind kind;
  std::string datatype;
  std::string md5sum;
  std::function<AnyInput(const RawMessage&)> read;
};

constexpr rbpf_core::InputKind kindOf(const OdometryInput*) {
  return rbpf_core::InputKind::kOdometry;
}
constexpr rbpf_core::InputKind kindOf(const PingInput*) { return rbpf_core::InputKind::kPing; }
constexpr rbpf_core::InputKind kindOf(const FixInput*) { return rbpf_core::InputKind::kFix; }

template <typename Message, typename Result>
MessageType messageType(Result (*convert)(const Message&)) {
  static_assert(ros::message_traits::HasHeader<Message>::value, "headerOf() reads it");
  return {kindOf(static_cast<const Result*>(nullptr)), ros::message_traits::datatype<Message>(),
          ros::message_traits::md5sum<Message>(),
          [convert](const RawMessage& raw) { return convert(deserialised<Message>(raw)); }};
}

// Another message is a function in a file of its own, and a line here.
const std::vector<MessageType>& messageTypes() {
  static const std::vector<MessageType> types = {
      messageType(fromOdometry),           messageType(fromPointCloud2), messageType(fromLaserScan),
      messageType(fromPoseWithCovariance), messageType(fromNavSatFix),
  };
  return types;
}

const MessageType* find(rbpf_core::InputKind kind, const std::string& datatype,
                        const std::string& md5sum) {
  for (const MessageType& type : messageTypes()) {
    if (type.kind == kind && type.datatype == datatype && type.md5sum == md5sum) return &type;
  }
  return nullptr;
}

}  // namespace

std::string expectedInsteadOf(rbpf_core::InputKind kind, const std::string& datatype,
                              const std::string& md5sum) {
  if (find(kind, datatype, md5sum) != nullptr) return "";
  std::string expected;
  for (const MessageType& type : messageTypes()) {
    if (type.kind != kind) continue;
    expected += (expected.empty() ? "" : " or ") + type.datatype;
    // the right name and another content: a version of the package that is not ours
    if (type.datatype == datatype) expected += " with the md5sum " + type.md5sum;
  }
  return expected;
}

AnyInput readInput(rbpf_core::InputKind kind, const RawMessage& raw) {
  const MessageType* type = find(kind, raw.datatype, raw.md5sum);
  if (type == nullptr) {
    throw rbpf_core::Refusal(rbpf_core::Reason::kWrongType,
                             "message is a " + raw.datatype + " with the md5sum " + raw.md5sum +
                                 ", expected " + expectedInsteadOf(kind, raw.datatype, raw.md5sum));
  }
  headerOf(raw);  // checks the stamp
  return type->read(raw);
}

}  // namespace rbpf_node
