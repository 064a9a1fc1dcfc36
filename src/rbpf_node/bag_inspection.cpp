#include "rbpf_node/bag_inspection.hpp"

#include <nav_msgs/Odometry.h>
#include <rosbag/view.h>
#include <tf2_eigen/tf2_eigen.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <stdexcept>
#include <utility>

#include "rbpf_core/motion_model.hpp"
#include "rbpf_node/bag_mounts.hpp"
#include "rbpf_node/json_text.hpp"

namespace rbpf_node {

using rbpf_core::InputKind;
using rbpf_core::Reason;

namespace {

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
// Of the pings that are taken in, whose beams are looked at one by one.
constexpr std::size_t kMostPingsSampled = 5000;
// Of each of them, evenly, its ends included.
constexpr Eigen::Index kBeamsSampled = 48;

// velocities: of the twist; variances: of its covariance
const std::vector<std::string> kOdometryColumns = {
    "record_s",  "stamp_s", "x_m",   "y_m",   "z_m",   "roll_rad",
    "pitch_rad", "yaw_rad", "u_mps", "v_mps", "w_mps", "p_radps",
    "q_radps",   "r_radps", "var_u", "var_v", "var_r"};
const std::vector<std::string> kPingColumns = {"record_s",    "stamp_s",        "frame",
                                               "beams",       "finite",         "within",
                                               "min_range_m", "median_range_m", "max_range_m"};
// the last five of sampled pings only
const std::vector<std::string> kPlacedColumns = {
    "stamp_s",    "good",          "vehicle_x_m",   "vehicle_y_m", "vehicle_z_m", "vehicle_yaw_rad",
    "median_z_m", "min_forward_m", "max_forward_m", "min_left_m",  "max_left_m"};
// ping: its row in the table of those that were placed
const std::vector<std::string> kBeamColumns = {"ping", "x_m", "y_m", "z_m", "forward_m", "left_m"};
const std::vector<std::string> kGroundTruthColumns = {
    "record_s", "stamp_s", "x_m", "y_m", "z_m", "roll_rad", "pitch_rad", "yaw_rad"};

double median(std::vector<double> values) {
  if (values.empty()) return kUnknown;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// Of surge, sway and yaw rate.
Eigen::Vector3d twistVariance(const RawMessage& raw) {
  if (raw.datatype != ros::message_traits::datatype<nav_msgs::Odometry>()) {
    return Eigen::Vector3d::Constant(kUnknown);
  }
  const auto& covariance = deserialised<nav_msgs::Odometry>(raw).twist.covariance;
  return {covariance[0], covariance[7], covariance[35]};
}

rbpf_core::FilterParams withOneParticle(rbpf_core::FilterParams params) {
  params.particles = 1;
  params.motion = {0.0, 0.0, 0.0};
  params.start_position_std_m = 0.0;
  params.start_yaw_std_rad = 0.0;
  return params;
}

}  // namespace

BagInspection::BagInspection(const Parameters& params)
    : params_(params),
      filter_(withOneParticle(params.filter)),
      intake_(params, Input::kBag, transforms_, &filter_),
      odometry_(kOdometryColumns),
      pings_(kPingColumns),
      placed_(kPlacedColumns),
      beams_(kBeamColumns),
      ground_truth_(kGroundTruthColumns) {}

void BagInspection::read(const rosbag::Bag& bag, const OfflineTopics& topics) {
  const StampOrder order = inStampOrder(bag, topics, params_.gate.clock);
  intake_.setClockOffset(order.clock_offset_s);
  intake_.refuse(order.refused);
  const Mounts mounts = mountsIn(bag, params_.frames, order.ping_frames);
  setMounts(mounts.first, bag, &transforms_);
  for (const auto& mount : mounts.first) {
    links_.push_back(json::texts({mount.header.frame_id, mount.child_frame_id}));
  }
  const auto pings = static_cast<std::size_t>(
      std::count_if(order.messages.begin(), order.messages.end(),
                    [](const auto& message) { return message.kind == InputKind::kPing; }));
  sample_every_ = 1 + pings / kMostPingsSampled;
  for (const StampedMessage& message : order.messages) {
    takeIn(message);
    tabulatePlaced();
  }
  setMounts(mounts.changed, bag, &transforms_);
  intake_.finish();
  tabulatePlaced();
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
  } catch (const rbpf_core::Refusal& refusal) {
    intake_.refuse(message.kind, refusal.reason(), refusal.what());
  } catch (const std::exception& error) {
    intake_.refuse(message.kind, Reason::kMalformed, error.what());
  }
}

// ---- odometry ------------------------------------------------------------------------------

void BagInspection::takeOdometry(const RawMessage& raw, double record_s) {
  const auto input = std::get<OdometryInput>(readInput(InputKind::kOdometry, raw));
  intake_.take(input, record_s);
  const rbpf_core::Odometry odometry = toOdometry(input, params_.frames);
  const Eigen::Vector3d variance = twistVariance(raw);
  const auto& [x_m, y_m, yaw_rad] = odometry.pose;
  const auto& [z_m, roll_rad, pitch_rad] = odometry.attitude;
  const Eigen::Vector3d& v = odometry.linear_mps;
  const Eigen::Vector3d& w = odometry.angular_radps;
  odometry_.add({record_s, odometry.stamp_s, x_m, y_m, z_m, roll_rad, pitch_rad, yaw_rad, v.x(),
                 v.y(), v.z(), w.x(), w.y(), w.z(), variance.x(), variance.y(), variance.z()});
  before_ = last_;
  last_ = odometry;
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
  auto input = std::get<PingInput>(readInput(InputKind::kPing, raw));
  const Ranges ranges = rangesOf(input.beams_m);
  pings_.add({record_s, input.stamp.toSec(), frameNumber(input.frame),
              static_cast<double>(input.beams_m.cols()), ranges.finite, ranges.within, ranges.min_m,
              ranges.median_m, ranges.max_m});
  intake_.take(std::move(input), record_s);
}

// Where the odometry's own pose puts them: it may know more than its twist does.
void BagInspection::tabulatePlaced() {
  const rbpf_core::FilterSnapshot filter = filter_.snapshot();
  while (placed_.rows() < filter.pings()) {
    const bool is_sampled = placed_.rows() % sample_every_ == 0;
    const rbpf_core::PingRecord& record = filter.record(placed_.rows());
    const rbpf_core::Odometry& from = before_ ? *before_ : *last_;
    const double between_s = last_->stamp_s - from.stamp_s;
    const double share = between_s > 0.0 ? (record.stamp_s - from.stamp_s) / between_s : 1.0;
    const rbpf_core::Pose2 pose =
        rbpf_core::interpolate(from.pose, last_->pose, std::clamp(share, 0.0, 1.0));
    std::vector<double> row = {
        record.stamp_s, static_cast<double>(record.beams), pose.x_m, pose.y_m, record.attitude.z_m,
        pose.yaw_rad};
    if (is_sampled) {
      const rbpf_core::SurveyPing ping = filter.survey(placed_.rows(), 1).front();
      const rbpf_core::Beams& levelled_m = ping.levelled_m;
      row.push_back(median({levelled_m.row(2).begin(), levelled_m.row(2).end()}));
      for (const Eigen::Index axis : {0, 1}) {
        row.push_back(levelled_m.row(axis).minCoeff());
        row.push_back(levelled_m.row(axis).maxCoeff());
      }
      sampleBeams(ping, pose);
    }
    row.resize(kPlacedColumns.size(), kUnknown);
    placed_.add(row);
  }
}

void BagInspection::sampleBeams(const rbpf_core::SurveyPing& ping, const rbpf_core::Pose2& pose) {
  const Eigen::Index n = ping.levelled_m.cols();
  const Eigen::Index sampled = std::min(n, kBeamsSampled);
  const auto number = static_cast<double>(placed_.rows());
  const double c = std::cos(pose.yaw_rad);
  const double s = std::sin(pose.yaw_rad);
  for (Eigen::Index k = 0; k < sampled; ++k) {
    const Eigen::Index i = sampled == 1 ? 0 : k * (n - 1) / (sampled - 1);
    const Eigen::Vector3d b = ping.levelled_m.col(i).cast<double>();
    // not placeBeams(): float32 is too coarse for coordinates far from the origin
    beams_.add({number, pose.x_m + c * b.x() - s * b.y(), pose.y_m + s * b.x() + c * b.y(), b.z(),
                b.x(), b.y()});
  }
}

BagInspection::Ranges BagInspection::rangesOf(const rbpf_core::Beams& beams_m) const {
  Ranges ranges{0.0, 0.0, kUnknown, kUnknown, kUnknown};
  const rbpf_core::PingFilterParams& bounds = params_.filter.pings;
  std::vector<double> finite_m;
  for (Eigen::Index i = 0; i < beams_m.cols(); ++i) {
    const double range_m = beams_m.col(i).norm();
    if (!std::isfinite(range_m)) continue;
    finite_m.push_back(range_m);
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
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    try {
      if (frame != params_.frames.base) {
        T = tf2::transformToEigen(
            transforms_.lookupTransform(params_.frames.base, frame, ros::Time(0)));
      }
    } catch (const tf2::TransformException&) {
      mounts.push_back(json::object({{"frame", json::text(frame)}}));
      continue;
    }
    const Eigen::Vector3d p = T.translation();
    const Eigen::Vector3d rpy = rollPitchYaw(Eigen::Quaterniond(T.linear()));
    mounts.push_back(
        json::object({{"frame", json::text(frame)},
                      {"translation_m", json::numbers({p.x(), p.y(), p.z()})},
                      {"roll_pitch_yaw_rad", json::numbers({rpy.x(), rpy.y(), rpy.z()})}}));
  }
  return json::list(mounts);
}

std::string BagInspection::refusals() const {
  std::vector<std::pair<std::string, std::string>> refusals;
  const IntakeState state = intake_.state();
  for (const auto& [what, count] : state.refused.counts()) {
    refusals.emplace_back(
        nameOf(what.first, what.second),
        json::object({{"messages", json::number(static_cast<double>(count.messages))},
                      {"first", json::text(count.example)}}));
  }
  return json::object(refusals);
}

std::string BagInspection::findings() const {
  std::vector<std::string> findings;
  for (const rbpf_core::Finding& finding : intake_.state().findings) {
    const bool is_error = finding.severity == rbpf_core::Severity::kError;
    findings.push_back(json::object({{"name", json::text(finding.name)},
                                     {"severity", json::text(is_error ? "error" : "warning")},
                                     {"text", json::text(finding.text)}}));
  }
  return json::list(findings);
}

void BagInspection::write(const std::string& folder) const {
  const std::vector<std::pair<std::string, const NumberTable*>> tables = {
      {"odometry", &odometry_},
      {"pings", &pings_},
      {"placed", &placed_},
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
                        {"findings", findings()},
                        {"mounts", mounts()},
                        {"links", json::list(links_)}})
       << "\n";
  file.close();
  if (!file) throw std::runtime_error(path + " cannot be written");
}

}  // namespace rbpf_node
