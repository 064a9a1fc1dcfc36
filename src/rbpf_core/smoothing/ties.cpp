#include "rbpf_core/smoothing/ties.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "gmrf/robust_spread.hpp"
#include "rbpf_core/rigid.hpp"
#include "rbpf_core/smoothing/beams_on_map.hpp"

namespace rbpf_core::smoothing {

namespace {

// Beams without which a pair tells nothing.
constexpr std::size_t kLeastPairBeams = 20;
// The beams of a cell of the map share its error and the relief below its grid: they count as so
// many independent ones, as a share of a window's effective beams.
constexpr double kShareOfCell = 0.025;
// Errors that all beams of a pair share: of the depth, m; of either sonar's roll, rad.
constexpr double kDepthError_m = 0.06;
constexpr double kRollError_rad = 0.001;
// The slope that holds a step back.
constexpr double kDampingSlope = 1e-2;
// Floors of standard deviations, m and rad.
constexpr double kLeastTieStd_m = 0.02;
constexpr double kLeastTieStd_rad = 0.001;

// A beam on the map. Its gradient is by x, y, yaw about the window's origin.
struct Hit {
  Eigen::Vector2d place_m;
  Eigen::Vector3d gradient;
  double residual_m;
  // Of the map there, against the beam's own: 1 where the map is sure.
  double trust;
};

// Sums over hits, the shared depth error eliminated.
struct NormalEquations {
  Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
  Eigen::Vector3d g = Eigen::Vector3d::Zero();
  // Of a beam, m^2; and independent beams over the sum of the weights.
  double variance_m2 = 0.0;
  double beams_per_weight = 0.0;
};

double aside(const Pose2& pose, const Eigen::Vector2d& place_m) {
  return -std::sin(pose.yaw_rad) * (place_m.x() - pose.x_m) +
         std::cos(pose.yaw_rad) * (place_m.y() - pose.y_m);
}

class Pairs {
 public:
  explicit Pairs(const LaidWindow& laid)
      : laid_(laid),
        found_(laid.registration.found.pose),
        arm2_m2_(armOf(laid)),
        beams_of_cell_(kShareOfCell * laid.effective_beams) {
    const Track::Range& range = laid.around_k;
    for (std::size_t m = range.first; m < range.last; ++m) {
      const Pose2 pose = relative(laid.poses[laid.k], laid.poses[m]);
      older_.push_back(pose);
      ahead_.emplace_back(std::cos(pose.yaw_rad), std::sin(pose.yaw_rad));
    }
  }

  void add(std::size_t younger, std::vector<Tie>* ties) const {
    const Pose2 at = compose(found_, relative(laid_.poses[laid_.j], laid_.poses[younger]));
    const std::vector<std::vector<Hit>> hits =
        byOlderNode(placed(laid_.track.nodes()[younger].beams_m, at));
    for (std::size_t m = 0; m < older_.size(); ++m) {
      if (hits[m].size() < kLeastPairBeams) continue;
      ties->push_back(
          {laid_.around_k.first + m, younger, solved(sumsOf(hits[m], at, older_[m]), at, m)});
    }
  }

 private:
  // Of the windows' mean square half width.
  static double armOf(const LaidWindow& laid) {
    const double half_m = laid.track.nodes()[laid.j].half_width_m;
    return std::max(1.0, half_m * half_m / 3.0);
  }

  // A map of n beams to a cell has the n-th part of a beam's variance, which all beams on the cell
  // share.
  double trustIn(double beams_of_map) const {
    return beams_of_map / (beams_of_map + beams_of_cell_);
  }

  std::vector<std::vector<Hit>> byOlderNode(const Beams& beams_m) const {
    std::vector<std::vector<Hit>> hits(older_.size());
    for (Eigen::Index b = 0; b < beams_m.cols(); ++b) {
      const LocalMap::Look look = laid_.map.at(beams_m(0, b), beams_m(1, b));
      if (!look.known) continue;
      const Eigen::Vector2d place_m = beams_m.col(b).head<2>().cast<double>();
      const double x = place_m.x() - found_.x_m;
      const double y = place_m.y() - found_.y_m;
      const Eigen::Vector2d slope =
          laid_.registration.told * Eigen::Vector2d(look.slope_x, look.slope_y);
      hits[ownerOf(place_m)].push_back({place_m,
                                        {slope.x(), slope.y(), slope.y() * x - slope.x() * y},
                                        beams_m(2, b) - look.z_m,
                                        trustIn(laid_.map.beamsAt(beams_m(0, b), beams_m(1, b)))});
    }
    return hits;
  }

  // The older node whose swath the place lies in.
  std::size_t ownerOf(const Eigen::Vector2d& place_m) const {
    std::size_t owner = 0;
    double least_m = std::numeric_limits<double>::infinity();
    for (std::size_t m = 0; m < older_.size(); ++m) {
      const double off_m =
          std::abs(ahead_[m].dot(place_m - Eigen::Vector2d(older_[m].x_m, older_[m].y_m)));
      if (off_m >= least_m) continue;
      least_m = off_m;
      owner = m;
    }
    return owner;
  }

  NormalEquations sumsOf(const std::vector<Hit>& hits, const Pose2& younger,
                         const Pose2& older) const {
    const auto n = static_cast<Eigen::Index>(hits.size());
    Eigen::VectorXd residuals(n);
    for (Eigen::Index i = 0; i < n; ++i) residuals(i) = hits[i].residual_m;
    const double level_m = gmrf::median(residuals);
    const double std_m =
        std::max(laid_.map.noise_std_m(), gmrf::robustStd(residuals.array() - level_m));

    NormalEquations sums;
    Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
    Eigen::Vector2d middle_m = Eigen::Vector2d::Zero();
    double residual = 0.0;
    double weight = 0.0;
    double trust = 0.0;
    std::vector<std::pair<int, int>> cells;
    const double spacing_m = laid_.map.spacing_m();
    for (const Hit& hit : hits) {
      const double off = (hit.residual_m - level_m) / std_m;
      const double w = hit.trust / (1.0 + off * off / kDegreesOfFreedom);
      sums.H += w * hit.gradient * hit.gradient.transpose();
      sums.g += w * hit.residual_m * hit.gradient;
      gradient += w * hit.gradient;
      residual += w * hit.residual_m;
      middle_m += w * hit.place_m;
      weight += w;
      trust += hit.trust;
      cells.emplace_back(std::floor(hit.place_m.x() / spacing_m),
                         std::floor(hit.place_m.y() / spacing_m));
    }
    std::sort(cells.begin(), cells.end());
    const auto touched = std::unique(cells.begin(), cells.end()) - cells.begin();
    middle_m /= weight;
    sums.variance_m2 = std_m * std_m + kMapError_m * kMapError_m;
    const double beams =
        std::min(beams_of_cell_ * static_cast<double>(touched), static_cast<double>(n));
    sums.beams_per_weight = beams * trust / static_cast<double>(n) / weight;
    // A depth error common to all: a fourth unknown, with a prior, by the Schur complement.
    const double roll2 =
        std::pow(aside(younger, middle_m), 2) + std::pow(aside(older, middle_m), 2);
    const double shared_m2 =
        kDepthError_m * kDepthError_m + kRollError_rad * kRollError_rad * roll2;
    const double all = weight + sums.variance_m2 / (sums.beams_per_weight * shared_m2);
    sums.H -= gradient * gradient.transpose() / all;
    sums.g -= gradient * residual / all;
    sums.H /= weight;
    sums.g /= weight;
    sums.beams_per_weight *= weight;
    return sums;
  }

  // Of a younger node `at` in older node m's frame.
  UncertainPose solved(const NormalEquations& sums, const Pose2& at, std::size_t m) const {
    const auto slopes = [this](double slope) -> Eigen::Matrix3d {
      return slope * slope * Eigen::Vector3d(1.0, 1.0, arm2_m2_).asDiagonal();
    };
    const Eigen::Vector3d step = (sums.H + slopes(kDampingSlope)).ldlt().solve(sums.g);
    const Eigen::Matrix3d information = sums.beams_per_weight / sums.variance_m2 *
                                        (laid_.registration.share * sums.H + slopes(kLeastSlope));

    // From a motion about the window's origin to one of the node, in the older node's axes.
    Eigen::Matrix3d A = Eigen::Matrix3d::Identity();
    A(0, 2) = -(at.y_m - found_.y_m);
    A(1, 2) = at.x_m - found_.x_m;
    const Eigen::Vector3d moved = A * step;
    const Pose2 to{at.x_m + moved.x(), at.y_m + moved.y(), at.yaw_rad + moved.z()};
    Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
    turn.topLeftCorner<2, 2>() = Eigen::Rotation2Dd(-older_[m].yaw_rad).toRotationMatrix();
    A = turn * A;
    const Eigen::Matrix3d covariance = A * information.inverse() * A.transpose();
    const Eigen::Vector3d floor(kLeastTieStd_m, kLeastTieStd_m, kLeastTieStd_rad);
    return {relative(older_[m], to), 0.5 * (covariance + covariance.transpose()) +
                                         floor.cwiseAbs2().asDiagonal().toDenseMatrix()};
  }

  const LaidWindow& laid_;
  const Pose2 found_;
  const double arm2_m2_;
  const double beams_of_cell_;
  // In node k's frame, and the directions that they look in.
  std::vector<Pose2> older_;
  std::vector<Eigen::Vector2d> ahead_;
};

}  // namespace

std::vector<Tie> tiesOf(const LaidWindow& laid, const Track::Range& younger) {
  const Pairs pairs(laid);
  std::vector<Tie> ties;
  for (std::size_t i = younger.first; i < younger.last; ++i) pairs.add(i, &ties);
  return ties;
}

}  // namespace rbpf_core::smoothing
