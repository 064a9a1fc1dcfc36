#include "rbpf_core/journal/change_bytes.hpp"

#include <array>
#include <cstring>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>

namespace rbpf_core {

namespace {

static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "numbers are written as they lie");

// Both have the same interface, so that one function says what a change consists of.
class Writer {
 public:
  template <typename T>
  void number(const T& value) {
    static_assert(std::is_arithmetic_v<T>);
    bytes(&value, sizeof(T));
  }
  // Resized by the reader to what it will take.
  template <typename Container>
  void size(const Container& container) {
    number(static_cast<std::uint64_t>(container.size()));
  }
  void columns(const Beams& beams) { number(static_cast<std::uint64_t>(beams.cols())); }
  template <typename T>
  void numbers(const T* first, std::size_t count) {
    static_assert(std::is_arithmetic_v<T>);
    bytes(first, count * sizeof(T));
  }
  std::vector<std::uint8_t> take() { return std::move(out_); }

 private:
  void bytes(const void* first, std::size_t count) {
    const auto* from = static_cast<const std::uint8_t*>(first);
    out_.insert(out_.end(), from, from + count);
  }
  std::vector<std::uint8_t> out_;
};

class Reader {
 public:
  explicit Reader(const std::vector<std::uint8_t>& in) : in_(in) {}

  template <typename T>
  void number(T& value) {
    numbers(&value, 1);
  }
  void number(bool& value) {
    std::uint8_t byte = 0;
    number(byte);
    value = byte != 0;
  }
  template <typename Container>
  void size(Container& container) {
    container.resize(count(sizeof(container[0])));
  }
  void columns(Beams& beams) {
    beams.resize(3, static_cast<Eigen::Index>(count(3 * sizeof(float))));
  }
  template <typename T>
  void numbers(T* first, std::size_t count) {
    expectMore(count, sizeof(T));
    if (count > 0) std::memcpy(first, in_.data() + at_, count * sizeof(T));
    at_ += count * sizeof(T);
  }
  void expectEnd() const {
    if (at_ != in_.size()) {
      throw std::invalid_argument(std::to_string(in_.size()) + " bytes, expected " +
                                  std::to_string(at_));
    }
  }

 private:
  void expectMore(std::uint64_t count, std::size_t each) const {
    if (count <= (in_.size() - at_) / each) return;
    throw std::invalid_argument(std::to_string(in_.size()) + " bytes, expected more");
  }
  std::size_t count(std::size_t each) {
    std::uint64_t count = 0;
    number(count);
    expectMore(count, each);
    return count;
  }
  const std::vector<std::uint8_t>& in_;
  std::size_t at_ = 0;
};

// T: const for a writer.
template <typename Archive, typename T>
void archiveOptional(Archive& archive, T& optional) {
  auto is_there = static_cast<std::uint8_t>(optional.has_value());
  double value = optional.value_or(0.0);
  archive.number(is_there);
  archive.number(value);
  if constexpr (!std::is_const_v<T>) {
    if (is_there != 0) optional = value;
  }
}

template <typename Archive, typename T>
void archiveHeading(Archive& archive, T& heading) {
  bool is_there = heading.has_value();
  Heading value = heading.value_or(Heading{});
  archive.number(is_there);
  archive.number(value.yaw_rad);
  archive.number(value.variance_rad2);
  if constexpr (!std::is_const_v<T>) {
    if (is_there) heading = value;
  }
}

template <typename Archive, typename Pose>
void archivePose(Archive& archive, Pose& pose) {
  archive.number(pose.x_m);
  archive.number(pose.y_m);
  archive.number(pose.yaw_rad);
}

template <typename Archive, typename Text>
void archiveText(Archive& archive, Text& text) {
  archive.size(text);
  archive.numbers(text.data(), text.size());
}

// ---- what each change consists of -----------------------------------------------------------

template <typename T, typename As>
constexpr bool kIs = std::is_same_v<std::remove_const_t<T>, As>;

template <typename Archive, typename T>
void archiveMeasurement(Archive& archive, T& change) {
  archive.number(change.stamp_s);
  if constexpr (kIs<T, Odometry>) {
    archivePose(archive, change.pose);
    archive.number(change.attitude.z_m);
    archive.number(change.attitude.roll_rad);
    archive.number(change.attitude.pitch_rad);
    archive.numbers(change.linear_mps.data(), 3);
    archive.numbers(change.angular_radps.data(), 3);
  } else if constexpr (kIs<T, Ping>) {
    archive.number(change.in_odometry_frame);
    archive.numbers(change.sensor_m.data(), 3);
    archive.columns(change.beams_m);
    archive.numbers(change.beams_m.data(), static_cast<std::size_t>(change.beams_m.size()));
  } else {
    static_assert(kIs<T, Fix>);
    archive.numbers(change.position_m.data(), 2);
    archive.numbers(change.covariance_m2.data(), 4);
    archiveHeading(archive, change.heading);
  }
}

template <typename Archive, typename Poses>
void archivePoses(Archive& archive, Poses& poses) {
  archive.size(poses);
  for (auto& pose : poses) archivePose(archive, pose);
}

template <typename Archive, typename T>
void archiveCorrection(Archive& archive, T& change) {
  archive.size(change.of_pings);
  for (auto& [ping, motion] : change.of_pings) {
    archive.number(ping);
    archivePose(archive, motion);
  }
  archivePose(archive, change.of_rest);
  archive.number(change.bias.surge_mps);
  archive.number(change.bias.sway_mps);
  archive.number(change.bias.yaw_radps);
  archive.number(change.bias.current_x_mps);
  archive.number(change.bias.current_y_mps);
  archive.number(change.redraws);
  archive.number(change.maps_follow);
}

template <typename Archive, typename T>
void archiveLoopClosing(Archive& archive, T& change) {
  archive.number(change.last_prompt_s);
  archive.number(change.prompts);
  archive.number(change.prompts_vetoed);
  archive.number(change.prompts_skipped);
  archive.number(change.resamplings_failed);
  archive.number(change.maps_moved);
  archive.number(change.bytes_moved);
}

template <typename Archive, typename T>
void archiveChange(Archive& archive, T& change) {
  if constexpr (kIs<T, FilterSettings>) {
    archiveText(archive, change.text);
  } else if constexpr (kIs<T, ProgramSettings>) {
    archive.number(change.survey);
    archiveText(archive, change.text);
  } else if constexpr (kIs<T, Odometry> || kIs<T, Ping> || kIs<T, Fix>) {
    archiveMeasurement(archive, change);
  } else if constexpr (kIs<T, OdometryKept>) {
    archiveOptional(archive, change.since_s);
  } else if constexpr (kIs<T, WeightsSet>) {
    archive.size(change.log_weights);
    archive.numbers(change.log_weights.data(), static_cast<std::size_t>(change.log_weights.size()));
  } else if constexpr (kIs<T, Resampled>) {
    archive.size(change.ancestors);
    archive.numbers(change.ancestors.data(), change.ancestors.size());
  } else if constexpr (kIs<T, DrawnAnew>) {
    archiveMeasurement(archive, change.given);
    archivePoses(archive, change.at);
  } else if constexpr (kIs<T, PastCorrection>) {
    archiveCorrection(archive, change);
  } else if constexpr (kIs<T, KnownError>) {
    archive.number(change.stamp_s);
    archivePose(archive, change.pose);
    archive.numbers(change.covariance.data(), 9);
    archiveOptional(archive, change.last_fix_s);
  } else if constexpr (kIs<T, LoopClosingState>) {
    archiveLoopClosing(archive, change);
  } else {
    static_assert(kIs<T, FixesTaken> || kIs<T, SurveyFinished>);
  }
}

template <std::size_t kType>
Change read(const std::vector<std::uint8_t>& bytes) {
  Reader reader(bytes);
  std::variant_alternative_t<kType, Change> change;
  archiveChange(reader, change);
  reader.expectEnd();
  return change;
}

template <std::size_t... kTypes>
Change readAny(std::size_t type, const std::vector<std::uint8_t>& bytes,
               std::index_sequence<kTypes...>) {
  using Read = Change (*)(const std::vector<std::uint8_t>&);
  static constexpr std::array<Read, sizeof...(kTypes)> kReads{&read<kTypes>...};
  return kReads.at(type)(bytes);
}

}  // namespace

std::vector<std::uint8_t> toBytes(const Change& change) {
  Writer writer;
  std::visit([&](const auto& one) { archiveChange(writer, one); }, change);
  return writer.take();
}

Change toChange(std::size_t type, const std::vector<std::uint8_t>& bytes) {
  constexpr std::size_t kTypes = std::variant_size_v<Change>;
  if (type >= kTypes) {
    throw std::invalid_argument("type " + std::to_string(type) + ", expected below " +
                                std::to_string(kTypes));
  }
  return readAny(type, bytes, std::make_index_sequence<kTypes>());
}

}  // namespace rbpf_core
