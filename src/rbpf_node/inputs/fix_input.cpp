#include "rbpf_node/inputs/fix_input.hpp"

#include <GeographicLib/LocalCartesian.hpp>
#include <cmath>

#include "rbpf_core/decimal.hpp"
#include "rbpf_core/refusal.hpp"

namespace rbpf_node {

namespace {

using rbpf_core::Reason;
using rbpf_core::Refusal;

Eigen::Vector2d inMap(const PlanePosition& position, const Frames& frames,
                      const FixInputParams& /*params*/) {
  if (position.frame == frames.map) return position.position_m;
  throw Refusal(Reason::kWrongFrame,
                "fix's header.frame_id is '" + position.frame + "', expected '" + frames.map + "'");
}

Eigen::Vector2d inMap(const Geographic& place, const Frames& /*frames*/,
                      const FixInputParams& params) {
  if (!std::isfinite(place.latitude_deg) || !std::isfinite(place.longitude_deg)) {
    throw Refusal(Reason::kNotFinite, "fix's latitude or longitude is not finite");
  }
  if (std::abs(place.latitude_deg) > 90.0 || std::abs(place.longitude_deg) > 360.0) {
    throw Refusal(Reason::kMalformed,
                  "fix lies at latitude " + rbpf_core::decimal(place.latitude_deg, 6) +
                      ", longitude " + rbpf_core::decimal(place.longitude_deg, 6) +
                      ", expected degrees within +-90 and +-360");
  }
  if (!params.survey_origin) {
    throw Refusal(Reason::kNoOrigin,
                  "fix is given in latitude and longitude, expected survey_origin to be set: where "
                  "the map frame's origin lies");
  }
  return eastNorth(place, *params.survey_origin);
}

}  // namespace

Eigen::Vector2d eastNorth(const Geographic& place, const Geographic& origin) {
  const GeographicLib::LocalCartesian plane(origin.latitude_deg, origin.longitude_deg, 0.0);
  double x_m = 0.0;
  double y_m = 0.0;
  double z_m = 0.0;
  plane.Forward(place.latitude_deg, place.longitude_deg, 0.0, x_m, y_m, z_m);
  return {x_m, y_m};
}

rbpf_core::Fix toFix(const FixInput& input, const Frames& frames, const FixInputParams& params) {
  const Eigen::Vector2d position_m = std::visit(
      [&](const auto& position) { return inMap(position, frames, params); }, input.position);
  const Eigen::Matrix2d unknown = params.std_m * params.std_m * Eigen::Matrix2d::Identity();
  return {input.stamp.toSec(), position_m, input.covariance_m2.value_or(unknown), input.heading};
}

}  // namespace rbpf_node
