// An absolute position of the vehicle, whatever message it came in.
#pragma once

#include <ros/time.h>

#include <Eigen/Core>
#include <optional>
#include <string>
#include <variant>

#include "rbpf_core/fix.hpp"
#include "rbpf_node/frames.hpp"

namespace rbpf_node {

// Of WGS84.
struct Geographic {
  double latitude_deg = 0.0;
  double longitude_deg = 0.0;
};

// In a frame, whose name has no slash before it.
struct PlanePosition {
  std::string frame;
  Eigen::Vector2d position_m = Eigen::Vector2d::Zero();
};

struct FixInput {
  ros::Time stamp;
  std::variant<PlanePosition, Geographic> position;
  // Of x and y, or east and north; none if the message does not tell it.
  std::optional<Eigen::Matrix2d> covariance_m2;
  // Only of a pose that an operator gives.
  std::optional<rbpf_core::Heading> heading;
};

// Defaults are those of config/default.yaml.
struct FixInputParams {
  // Where the map frame's origin lies; x points east, y north.
  std::optional<Geographic> survey_origin;
  // Of fixes that do not tell it.
  double std_m = 5.0;
};

// In map. Throws Refusal if the frame is another, if a latitude or longitude is none, or if they
// come without a survey_origin.
rbpf_core::Fix toFix(const FixInput& input, const Frames& frames, const FixInputParams& params);

// x, y of a place in a plane that touches the earth at the origin, x to the east; heights left out
// of account.
Eigen::Vector2d eastNorth(const Geographic& place, const Geographic& origin);

}  // namespace rbpf_node
