#include "rbpf_node/bag_inspection.hpp"

#include <nav_msgs/Odometry.h>
#include <rosbag/view.h>
#include <tf2_eigen/tf2_eigen.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <utility>

#include "rbpf_core/motion_model.hpp"
#include "rbpf_core/ping_filter.hpp"
#include "rbpf_node/bag_mounts.hpp"
#include "rbpf_node/conversions.hpp"
#include "rbpf_node/json_text.hpp"

namespace rbpf_node {

namespace {

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
// Whose beams are levelled, freed of outliers and placed.
constexpr std::size_t kMostPingsSampled = 5000;
// Of each of them, evenly, its ends included.
constexpr Eigen::Index kBeamsSampled = 48;

const std::vector<std::string> kOdometryColumns = {
    "record_s", "stamp_s", "x_m",   "y_m",   "z_m",     "roll_rad", "pitch_rad",
    "yaw_rad",  "u_mps",   "v_mps", "w_mps", "p_radps", "q_radps",  "r_radps",  // of the twist
    "var_u",    "var_v",   "var_r"};                                            // its covariance
const std::vector<std::string> kPingColumns = {
    "record_s", "stamp_s", "frame", "beams", "finite", "within", "min_range_m", "median_range_m",
    "max_range_m",
    // where it was placed, of sampled pings
    "good", "vehicle_x_m", "vehicle_y_m", "vehicle_z_m", "vehicle_yaw_rad", "median_z_m",
    "min_forward_m", "max_forward_m", "min_left_m", "max_left_m"};
constexpr std::size_t kWithin = 5;
constexpr std::ptrdiff_t kPlaced = 9;
const std::vector<std::string> kBeamColumns = {"ping", "x_m", "y_m", "z_m", "forward_m", "left_m"};
const std::vector<std::string> kGroundTruthColumns = {
    "record_s", "stamp_s", "x_m", "y_m", "z_m", "roll_rad", "pitch_rad", "yaw_rad"};

double median(std::vector<double> values) {
  if (values.empty()) return kUnknown;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// Variances of surge, sway and yaw rate, as the message gives them.
Eigen::Vector3d twistVariance(const RawMessage& raw) {
  if (raw.datatype != ros::message_traits::datatype<nav_msgs::Odometry>()) {
    return Eigen::Vector3d::Constant(kUnknown);
  }
  const auto& covariance = deserialised<nav_msgs::Odometry>(raw).twist.covariance;
  return {covariance[0], covariance[7], covariance[35]};
}

}  // namespace

BagInspection::BagInspection(const Parameters& params)
    : params_(params),
      odometry_(kOdometryColumns),
      pings_(kPingColumns),
      beams_(kBeamColumns),
      ground_truth_(kGroundTruthColumns) {}

void BagInspection::read(const rosbag::Bag& bag, const OfflineTopics& topics) {
  const StampOrder order = inStampOrder(bag, topics);
  refused_.add(order.refused);
  for (const auto& mount : mountsIn(bag, params_.frames, order.ping_frames)) {
    transforms_.setTransform(mount, bag.getFileName(), true);
    links_.push_back(json::texts({mount.header.frame_id, mount.child_frame_id}));
  }
  const auto pings = static_cast<std::size_t>(
      std::count_if(order.messages.begin(), order.messages.end(),
                    [](const auto& message) { return message.kind == InputKind::kPing; }));
  sample_every_ = 1 + pings / kMostPingsSampled;
  for (const StampedMessage& message : order.messages) takeIn(message);
  for (const Ping& ping : waiting_) {
    pings_.add(rowOf(ping));
    refused_.add(InputKind::kPing, Reason::kNoOdometry,
                 "ping of stamp " + std::to_string(ping.input.stamp.toSec()) +
                     " s: no odometry at or after it");
  }
  waiting_.clear();
}

void BagInspection::takeIn(const StampedMessage& message) {
  const double record_s = message.instance.getTime().toSec();
  try {
    const RawMessage raw = rawMessage(message.instance);
    if (message.kind == InputKind::kOdometry) {
      takeOdometry(raw, record_s);
    } else {
      takePing(raw, record_s);
    }
  } catch (const Refusal& refusal) {
    refused_.add(message.kind, refusal.reason(), refusal.what());
  } catch (const std::exception& error) {
    refused_.add(message.kind, Reason::kMalformed, error.what());
  }
}

// ---- odometry ------------------------------------------------------------------------------

void BagInspection::takeOdometry(const RawMessage& raw, double record_s) {
  const auto input = std::get<OdometryInput>(readInput(InputKind::kOdometry, raw));
  const rbpf_core::Odometry odometry = toOdometry(input, params_.frames);
  // THE GATE: what the node refuses of messages that can be read
  if (last_ && odometry.stamp_s <= last_->stamp_s) {
    throw Refusal(Reason::kDuplicateStamp, "odometry's stamp is " +
                                               std::to_string(odometry.stamp_s) +
                                               " s, expected later than the last one's");
  }
  const Eigen::Vector3d variance = twistVariance(raw);
  const auto& [x_m, y_m, yaw_rad] = odometry.pose;
  const auto& [z_m, roll_rad, pitch_rad] = odometry.attitude;
  const Eigen::Vector3d& v = odometry.linear_mps;
  const Eigen::Vector3d& w = odometry.angular_radps;
  odometry_.add({record_s, odometry.stamp_s, x_m, y_m, z_m, roll_rad, pitch_rad, yaw_rad, v.x(),
                 v.y(), v.z(), w.x(), w.y(), w.z(), variance.x(), variance.y(), variance.z()});
  before_ = last_;
  last_ = odometry;
  takeWaiting();
}

void BagInspection::readGroundTruth(const rosbag::Bag& bag, const std::string& topic) {
  for (const rosbag::MessageInstance& instance : rosbag::View(bag, rosbag::TopicQuery(topic))) {
    try {
      const auto input =
          std::get<OdometryInput>(readInput(InputKind::kOdometry, rawMessage(instance)));
      const Eigen::Vector3d& p = input.position_m;
      const Eigen::Vector3d rpy = rollPitchYaw(input.orientation.normalized());
      ground_truth_.add({instance.getTime().toSec(), input.stamp.toSec(), p.x(), p.y(), p.z(),
                         rpy.x(), rpy.y(), rpy.z()});
    } catch (const std::exception&) {
      continue;  // the filter does not need it
    }
  }
}

// ---- pings ---------------------------------------------------------------------------------

void BagInspection::takePing(const RawMessage& raw, double record_s) {
  waiting_.push_back({std::get<PingInput>(readInput(InputKind::kPing, raw)), record_s});
  frameNumber(waiting_.back().input.frame);
  if (last_ && last_->stamp_s >= waiting_.back().input.stamp.toSec()) takeWaiting();
}

void BagInspection::takeWaiting() {
  while (!waiting_.empty() && waiting_.front().input.stamp.toSec() <= last_->stamp_s) {
    const Ping ping = std::move(waiting_.front());
    waiting_.pop_front();
    try {
      tabulate(ping);
    } catch (const Refusal& refusal) {
      refused_.add(InputKind::kPing, refusal.reason(), refusal.what());
    }
  }
}

std::optional<Eigen::Isometry3d> BagInspection::mountOf(const std::string& frame) const {
  const std::string& base = params_.frames.base;
  // tf2 knows no frame of which nobody has told it
  if (frame == base) return Eigen::Isometry3d::Identity();
  try {
    return tf2::transformToEigen(transforms_.lookupTransform(base, frame, ros::Time(0)));
  } catch (const tf2::TransformException&) {
    return std::nullopt;
  }
}

// As it came, not yet placed.
std::vector<double> BagInspection::rowOf(const Ping& ping) {
  const rbpf_core::Beams& beams_m = ping.input.beams_m;
  const Ranges ranges = rangesOf(beams_m);
  std::vector<double> row = {ping.record_s,
                             ping.input.stamp.toSec(),
                             frameNumber(ping.input.frame),
                             static_cast<double>(beams_m.cols()),
                             ranges.finite,
                             ranges.within,
                             ranges.min_m,
                             ranges.median_m,
                             ranges.max_m};
  row.resize(kPingColumns.size(), kUnknown);
  return row;
}

void BagInspection::tabulate(const Ping& ping) {
  const double stamp_s = ping.input.stamp.toSec();
  const std::string name = "ping of stamp " + std::to_string(stamp_s) + " s";
  std::vector<double> row = rowOf(ping);
  const bool is_sampled = pings_.rows() % sample_every_ == 0;
  const bool has_odometry = stamp_s == last_->stamp_s || (before_ && stamp_s >= before_->stamp_s);
  const auto T_base_sensor = mountOf(ping.input.frame);
  if (has_odometry && T_base_sensor && is_sampled) place(ping, *T_base_sensor, &row);
  pings_.add(row);
  if (!has_odometry) throw Refusal(Reason::kNoOdometry, name + ": no odometry before it");
  if (!T_base_sensor) {
    throw Refusal(Reason::kNoMount, name + ": no transform from '" + ping.input.frame + "' to '" +
                                        params_.frames.base + "'");
  }
  if (row[kWithin] == 0.0) {
    throw Refusal(Reason::kNoBeams, name + ": no beam is finite and within range");
  }
}

void BagInspection::place(const Ping& ping, const Eigen::Isometry3d& T_base_sensor,
                          std::vector<double>* row) {
  const rbpf_core::Odometry& from = before_ ? *before_ : *last_;
  const double between_s = last_->stamp_s - from.stamp_s;
  const double share =
      between_s > 0.0 ? (ping.input.stamp.toSec() - from.stamp_s) / between_s : 1.0;
  const auto pose = rbpf_core::interpolate(from.pose, last_->pose, share);
  const auto attitude = rbpf_core::interpolate(from.attitude, last_->attitude, share);
  const rbpf_core::Beams levelled_m =
      rbpf_core::goodBeams(toPing(ping.input, T_base_sensor), attitude, params_.filter.pings);
  std::vector<double> z_m;
  for (Eigen::Index i = 0; i < levelled_m.cols(); ++i) z_m.push_back(levelled_m(2, i));
  std::vector<double> placed = {static_cast<double>(levelled_m.cols()),
                                pose.x_m,
                                pose.y_m,
                                attitude.z_m,
                                pose.yaw_rad,
                                median(z_m)};
  if (!z_m.empty()) {
    for (const Eigen::Index axis : {0, 1}) {
      placed.push_back(levelled_m.row(axis).minCoeff());
      placed.push_back(levelled_m.row(axis).maxCoeff());
    }
  }
  std::copy(placed.begin(), placed.end(), row->begin() + kPlaced);
  sampleBeams(static_cast<double>(pings_.rows()), levelled_m, pose);
}

BagInspection::Ranges BagInspection::rangesOf(const rbpf_core::Beams& beams_m) const {
  Ranges ranges{0.0, 0.0, kUnknown, kUnknown, kUnknown};
  std::vector<double> finite_m;
  for (Eigen::Index i = 0; i < beams_m.cols(); ++i) {
    const double range_m = beams_m.col(i).norm();
    if (!std::isfinite(range_m)) continue;
    finite_m.push_back(range_m);
    const rbpf_core::PingFilterParams& bounds = params_.filter.pings;
    if (range_m >= bounds.min_range_m && range_m <= bounds.max_range_m) ++ranges.within;
  }
  if (finite_m.empty()) return ranges;
  ranges.finite = static_cast<double>(finite_m.size());
  const auto [least, most] = std::minmax_element(finite_m.begin(), finite_m.end());
  ranges.min_m = *least;
  ranges.max_m = *most;
  ranges.median_m = median(finite_m);
  return ranges;
}

void BagInspection::sampleBeams(double ping, const rbpf_core::Beams& levelled_m,
                                const rbpf_core::Pose2& pose) {
  const Eigen::Index n = levelled_m.cols();
  const Eigen::Index sampled = std::min(n, kBeamsSampled);
  const double c = std::cos(pose.yaw_rad);
  const double s = std::sin(pose.yaw_rad);
  for (Eigen::Index k = 0; k < sampled; ++k) {
    const Eigen::Index i = sampled == 1 ? 0 : k * (n - 1) / (sampled - 1);
    const Eigen::Vector3d b = levelled_m.col(i).cast<double>();
    // not placeBeams(): float32 is too coarse for coordinates far from the origin
    beams_.add({ping, pose.x_m + c * b.x() - s * b.y(), pose.y_m + s * b.x() + c * b.y(), b.z(),
                b.x(), b.y()});
  }
}

double BagInspection::frameNumber(const std::string& frame) {
  const auto known = std::find(frames_.begin(), frames_.end(), frame);
  const auto number = known - frames_.begin();
  if (known == frames_.end()) frames_.push_back(frame);
  return static_cast<double>(number);
}

// ---- facts ---------------------------------------------------------------------------------

std::string BagInspection::mounts() const {
  std::vector<std::string> mounts;
  for (const std::string& frame : frames_) {
    const auto T = mountOf(frame);
    if (!T) {
      mounts.push_back(json::object({{"frame", json::text(frame)}, {"is_known", "false"}}));
      continue;
    }
    const Eigen::Vector3d p = T->translation();
    const Eigen::Vector3d rpy = rollPitchYaw(Eigen::Quaterniond(T->linear()));
    mounts.push_back(
        json::object({{"frame", json::text(frame)},
                      {"is_known", "true"},
                      {"translation_m", json::numbers({p.x(), p.y(), p.z()})},
                      {"roll_pitch_yaw_rad", json::numbers({rpy.x(), rpy.y(), rpy.z()})}}));
  }
  return json::list(mounts);
}

std::string BagInspection::refusals() const {
  std::vector<std::pair<std::string, std::string>> refusals;
  for (const auto& [what, count] : refused_.counts()) {
    refusals.emplace_back(
        nameOf(what.first, what.second),
        json::object({{"messages", json::number(static_cast<double>(count.messages))},
                      {"first", json::text(count.example)}}));
  }
  return json::object(refusals);
}

void BagInspection::write(const std::string& folder) const {
  const std::vector<std::pair<std::string, const NumberTable*>> tables = {
      {"odometry", &odometry_},
      {"pings", &pings_},
      {"beams", &beams_},
      {"ground_truth", &ground_truth_}};
  std::vector<std::pair<std::string, std::string>> columns;
  for (const auto& [name, table] : tables) {
    table->write(folder + "/" + name + ".npy");
    columns.emplace_back(name, json::texts(table->columns()));
  }
  const std::string path = folder + "/facts.json";
  std::ofstream file(path);
  file << json::object({{"columns", json::object(columns)},
                        {"refused", refusals()},
                        {"mounts", mounts()},
                        {"links", json::list(links_)}})
       << "\n";
  file.close();
  if (!file) throw std::runtime_error(path + " cannot be written");
}

}  // namespace rbpf_node
