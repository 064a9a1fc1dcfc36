#include "rbpf_core/smoothing/registration.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "rbpf_core/rigid.hpp"
#include "rbpf_core/smoothing/beams_on_map.hpp"
#include "rbpf_core/smoothing/thinned.hpp"

namespace rbpf_core::smoothing {

namespace {

// Beams that take part in the search, and in what follows.
constexpr Eigen::Index kSearchBeams = 300;
constexpr Eigen::Index kBeams = 1200;
// The search goes so many standard deviations each way, and at least so many steps.
constexpr double kReach = 3.0;
constexpr int kLeastSteps = 2;
constexpr int kMostTurns = 4;
// Places of the search from which Gauss-Newton starts; and those that it starts from in addition,
// so that the best place's rivals are seen, if the search found them worse by less than so many
// nats: between the nodes of its grid.
constexpr std::size_t kStarts = 6;
constexpr std::size_t kRivals = 4;
constexpr double kWorthALook = 25.0;
constexpr int kIterations = 15;
// Beams on the map: at least this share of all, and of those that the best place has; and so many.
constexpr double kLeastShare = 0.25;
constexpr double kLeastBeams = 100;
// RMS of the beams over the map's own noise.
constexpr double kWorstFit = 2.5;
constexpr double kGoodFit = 1.5;
// A closure tells nothing if the direction that it knows best is known worse than so many cells.
constexpr double kFlatCells = 2.0;
// Floors of a closure's standard deviations, m and rad.
constexpr double kLeastStd_m = 0.05;
constexpr double kLeastStd_rad = 0.003;
// Correlation of both maps' slopes along a direction below which they tell nothing about it.
constexpr double kLeastCoherence = 0.3;
// Another place is ruled out if it is less likely than the best by so many nats.
constexpr double kRuledOut = 5.0;
// Squared distances in standard deviations: of places that are one and the same; and of a place
// from where it was expected, chi-squared of 3 at 0.999.
constexpr double kSame = 16.0;
constexpr double kUnexpected = 16.27;
// Standard deviations of the wider search, over those of what was expected.
constexpr double kWider = 3.0;

Eigen::Vector3d difference(const Pose2& a, const Pose2& b) {
  return {a.x_m - b.x_m, a.y_m - b.y_m, wrapAngle(a.yaw_rad - b.yaw_rad)};
}

double squaredDistance(const Eigen::Vector3d& d, const Eigen::Matrix3d& covariance) {
  return d.dot(covariance.ldlt().solve(d));
}

class Registrar {
 public:
  Registrar(const LocalMap& map, const WindowOfPings& window, const UncertainPose& expected,
            const RegistrationParams& params)
      : map_(map),
        own_map_(window.map),
        beams_(thinned(window.beams_m, kBeams)),
        expected_(expected),
        params_(params),
        scale2_(kDegreesOfFreedom * map.noise_std_m() * map.noise_std_m()),
        nats_per_log_(params.effective_beams * 0.5 * (kDegreesOfFreedom + 1.0)),
        held_((kReach * kReach * expected.covariance).inverse()) {}

  bool isExpected(const UncertainPose& found) const {
    return squaredDistance(difference(found.pose, expected_.pose),
                           expected_.covariance + found.covariance) < kUnexpected;
  }

  Registration run() const {
    Registration result;
    result.found = expected_;
    const bool empty = map_.spacing_m() == 0.0;
    if (empty || beams_.cols() < kLeastBeams) return result;
    const std::vector<Start> starts = searched();
    std::vector<Place> places;
    for (std::size_t i = 0; i < std::min(kStarts, starts.size()); ++i) {
      if (const auto place = refine(starts[i].pose)) places.push_back(*place);
    }
    if (places.empty()) return result;
    sort(&places);
    addRivals(starts, &places);
    sort(&places);
    const Place& best = places.front();
    result.found = best.found;
    result.rms_m = best.rms_m;
    result.beams = static_cast<std::uint32_t>(best.beams);
    result.told = best.told;
    result.share = best.share;
    result.verdict = verdictOn(places);
    return result;
  }

 private:
  struct Place {
    UncertainPose found;
    // Nats, with what was expected.
    double cost;
    double rms_m;
    Eigen::Index beams;
    Eigen::Matrix2d told;
    double share;
  };

  // What the relief tells of x, y, yaw.
  struct SharedRelief {
    // The Hessian per beam.
    Eigen::Matrix3d hessian;
    // As in Registration.
    Eigen::Matrix2d told;
    double share;
  };

  // Of the search.
  struct Start {
    double cost;
    Pose2 pose;
  };

  template <typename T>
  static void sort(std::vector<T>* places) {
    std::sort(places->begin(), places->end(),
              [](const T& a, const T& b) { return a.cost < b.cost; });
  }

  // Along a crest there are many places that fit alike, and the search's best may all lie on one:
  // from those on others, too.
  void addRivals(const std::vector<Start>& starts, std::vector<Place>* places) const {
    Eigen::Matrix3d near = places->front().found.covariance;
    near.topLeftCorner<2, 2>().diagonal().array() += 0.25 * map_.spacing_m() * map_.spacing_m();
    std::size_t rivals = 0;
    for (std::size_t i = kStarts; i < starts.size() && rivals < kRivals; ++i) {
      const Start& start = starts[i];
      if (start.cost > starts.front().cost + kWorthALook) return;
      const bool seen = std::any_of(places->begin(), places->end(), [&](const Place& place) {
        return squaredDistance(difference(start.pose, place.found.pose), near) < kSame;
      });
      if (seen) continue;
      ++rivals;
      if (const auto place = refine(start.pose)) places->push_back(*place);
    }
  }

  Verdict verdictOn(const std::vector<Place>& places) const {
    const Place& best = places.front();
    if (best.beams < kLeastBeams || best.beams < kLeastShare * beams_.cols()) {
      return Verdict::kLittleOverlap;
    }
    if (best.rms_m > kWorstFit * map_.noise_std_m()) return Verdict::kBadFit;
    const Eigen::Matrix2d position = best.found.covariance.topLeftCorner<2, 2>();
    const double least2 = Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(position).eigenvalues()(0);
    if (std::sqrt(least2) > kFlatCells * map_.spacing_m()) return Verdict::kFlat;
    for (const Place& other : places) {
      const Eigen::Vector3d d = difference(other.found.pose, best.found.pose);
      const bool same = squaredDistance(d, best.found.covariance) < kSame;
      if (!same && other.cost < best.cost + kRuledOut) return Verdict::kAmbiguous;
    }
    return isExpected(best.found) ? Verdict::kAccepted : Verdict::kAmbiguous;
  }

  // Minima of the mean cost on a grid around where the window is expected, the best ones first.
  std::vector<Start> searched() const {
    const Beams few = thinned(beams_, kSearchBeams);
    const double step_m = map_.spacing_m();
    const auto stepsFor = [&](double std, double step, int least, double most) {
      return std::max(least, static_cast<int>(std::ceil(std::min(kReach * std, most) / step)));
    };
    const Eigen::Matrix3d& P = expected_.covariance;
    const int nx = stepsFor(std::sqrt(P(0, 0)), step_m, kLeastSteps, params_.max_search_m);
    const int ny = stepsFor(std::sqrt(P(1, 1)), step_m, kLeastSteps, params_.max_search_m);
    // A turn by one step moves the outermost beams by about one step.
    const double half_m = std::max(
        1.0, static_cast<double>(std::sqrt(few.topRows<2>().colwise().squaredNorm().maxCoeff())));
    const double turn_rad = 1.5 * step_m / half_m;
    const int turns = std::min(
        kMostTurns, static_cast<int>(std::floor(kReach * std::sqrt(P(2, 2)) / turn_rad + 0.5)));

    const std::size_t across = 2 * ny + 1;
    const std::size_t count = (2 * nx + 1) * across;
    std::vector<Start> starts;
    for (int turn = -turns; turn <= turns; ++turn) {
      const double yaw = expected_.pose.yaw_rad + turn * turn_rad;
      const Eigen::Matrix2Xf turned =
          Eigen::Rotation2Df(static_cast<float>(yaw)).toRotationMatrix() * few.topRows<2>();
      std::vector<double> cost(count);
      std::vector<int> on_map(count);
      for (int ix = -nx; ix <= nx; ++ix) {
        for (int iy = -ny; iy <= ny; ++iy) {
          const auto x = static_cast<float>(expected_.pose.x_m + ix * step_m);
          const auto y = static_cast<float>(expected_.pose.y_m + iy * step_m);
          double sum = 0.0;
          int n = 0;
          for (Eigen::Index b = 0; b < few.cols(); ++b) {
            const LocalMap::Look look = map_.at(x + turned(0, b), y + turned(1, b));
            if (!look.known) continue;
            const float r = few(2, b) - look.z_m;
            sum += std::log1p(r * r / static_cast<float>(2.0 * scale2_));
            ++n;
          }
          const std::size_t at = (ix + nx) * across + (iy + ny);
          on_map[at] = n;
          cost[at] = sum / std::max(n, 1);
        }
      }
      const int most = *std::max_element(on_map.begin(), on_map.end());
      const int least = std::max(static_cast<int>(kLeastShare * most),
                                 static_cast<int>(kLeastShare * few.cols() / 2));
      const auto at = [&](int ix, int iy) {
        const std::size_t k = (ix + nx) * across + (iy + ny);
        return on_map[k] < least || on_map[k] == 0 ? 1e9 : cost[k];
      };
      for (int ix = -nx; ix <= nx; ++ix) {
        for (int iy = -ny; iy <= ny; ++iy) {
          const double here = at(ix, iy);
          bool lowest = here < 1e9;
          for (int dx = -1; dx <= 1 && lowest; ++dx) {
            for (int dy = -1; dy <= 1 && lowest; ++dy) {
              if (std::abs(ix + dx) > nx || std::abs(iy + dy) > ny) continue;
              lowest = here <= at(ix + dx, iy + dy);
            }
          }
          if (!lowest) continue;
          const Pose2 pose{expected_.pose.x_m + ix * step_m, expected_.pose.y_m + iy * step_m, yaw};
          starts.push_back({nats(here) + surprise(pose), pose});
        }
      }
    }
    sort(&starts);
    return starts;
  }

  std::optional<Place> refine(Pose2 pose) const {
    double weight = 0.0;
    double squares = 0.0;
    double cost = 0.0;
    Eigen::Index n = 0;
    for (int iteration = 0; iteration < kIterations; ++iteration) {
      Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
      Eigen::Vector3d g = Eigen::Vector3d::Zero();
      weight = squares = cost = 0.0;
      n = 0;
      const auto c = static_cast<float>(std::cos(pose.yaw_rad));
      const auto s = static_cast<float>(std::sin(pose.yaw_rad));
      for (Eigen::Index b = 0; b < beams_.cols(); ++b) {
        const float x = c * beams_(0, b) - s * beams_(1, b);
        const float y = s * beams_(0, b) + c * beams_(1, b);
        const LocalMap::Look look =
            map_.at(static_cast<float>(pose.x_m) + x, static_cast<float>(pose.y_m) + y);
        if (!look.known) continue;
        ++n;
        const double r = beams_(2, b) - look.z_m;
        const double w = 1.0 / (1.0 + r * r / scale2_);
        const Eigen::Vector3d J(look.slope_x, look.slope_y, look.slope_y * x - look.slope_x * y);
        H += w * J * J.transpose();
        g += w * r * J;
        weight += w;
        squares += w * r * r;
        cost += std::log1p(r * r / scale2_);
      }
      if (n < kLeastBeams) return std::nullopt;
      const double told = nats_per_log_ * 2.0 / (scale2_ * static_cast<double>(n));
      Eigen::Vector3d step =
          (told * H + held_).ldlt().solve(told * g + held_ * difference(expected_.pose, pose));
      const double length_m = step.head<2>().norm();
      if (length_m > map_.spacing_m()) step *= map_.spacing_m() / length_m;
      pose.x_m += step.x();
      pose.y_m += step.y();
      pose.yaw_rad = wrapAngle(pose.yaw_rad + step.z());
      if (step.head<2>().norm() < 1e-4) break;
    }
    Place place;
    place.rms_m = std::sqrt(squares / weight);
    const double variance = place.rms_m * place.rms_m + kMapError_m * kMapError_m;
    place.found.pose = pose;
    const SharedRelief relief = sharedRelief(pose);
    place.told = relief.told;
    place.share = relief.share;
    place.found.covariance = (relief.hessian * params_.effective_beams / variance).inverse();
    place.found.covariance.diagonal() +=
        Eigen::Vector3d(kLeastStd_m, kLeastStd_m, kLeastStd_rad).cwiseAbs2();
    place.beams = n;
    place.cost = nats(cost / static_cast<double>(n)) + surprise(pose);
    return place;
  }

  // Whether both maps' slopes along a direction go together.
  template <typename Vector, typename Matrix>
  static bool isCoherent(const Vector& v, const Matrix& both, const Matrix& there,
                         const Matrix& here) {
    return v.dot(both * v) > kLeastCoherence * std::sqrt(v.dot(there * v) * v.dot(here * v));
  }

  // The Hessian by x, y, yaw, per beam. Of slopes that both windows have, each in its own map: the
  // noise of one map's slopes tells nothing, and does not count.
  SharedRelief sharedRelief(const Pose2& pose) const {
    const auto c = static_cast<float>(std::cos(pose.yaw_rad));
    const auto s = static_cast<float>(std::sin(pose.yaw_rad));
    Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
    Eigen::Matrix3d power_there = Eigen::Matrix3d::Zero();
    Eigen::Matrix3d power_here = Eigen::Matrix3d::Zero();
    double weight = 0.0;
    double squared_arm = 0.0;
    for (Eigen::Index b = 0; b < beams_.cols(); ++b) {
      const float x = c * beams_(0, b) - s * beams_(1, b);
      const float y = s * beams_(0, b) + c * beams_(1, b);
      const LocalMap::Look look =
          map_.at(static_cast<float>(pose.x_m) + x, static_cast<float>(pose.y_m) + y);
      const LocalMap::Look own = own_map_.at(beams_(0, b), beams_(1, b));
      if (!look.known || !own.known) continue;
      const double r = beams_(2, b) - look.z_m;
      const double w = 1.0 / (1.0 + r * r / scale2_);
      const auto J = [x, y](float slope_x, float slope_y) {
        return Eigen::Vector3d(slope_x, slope_y, slope_y * x - slope_x * y);
      };
      const Eigen::Vector3d there = J(look.slope_x, look.slope_y);
      const Eigen::Vector3d here =
          J(c * own.slope_x - s * own.slope_y, s * own.slope_x + c * own.slope_y);
      H += 0.5 * w * (there * here.transpose() + here * there.transpose());
      power_there += w * there * there.transpose();
      power_here += w * here * here.transpose();
      weight += w;
      squared_arm += w * (x * x + y * y);
    }
    if (weight == 0.0) {
      return {kLeastSlope * kLeastSlope * Eigen::Matrix3d::Identity(), Eigen::Matrix2d::Zero(),
              0.0};
    }
    // Lengths for angles, so that eigenvalues can be compared with a slope.
    const double arm_m = std::max(1.0, std::sqrt(squared_arm / weight));
    const Eigen::Vector3d scale(1.0, 1.0, arm_m);
    const auto perBeam = [&](const Eigen::Matrix3d& sum) -> Eigen::Matrix3d {
      return scale.cwiseInverse().asDiagonal() * (sum / weight) * scale.cwiseInverse().asDiagonal();
    };
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(perBeam(H));
    const Eigen::Matrix3d V = eigen.eigenvectors();
    Eigen::Vector3d values = eigen.eigenvalues();
    for (int d = 0; d < 3; ++d) {
      if (!isCoherent(V.col(d), perBeam(H), perBeam(power_there), perBeam(power_here))) {
        values(d) = 0.0;
      }
      values(d) = std::max(values(d), kLeastSlope * kLeastSlope);
    }
    const Eigen::Matrix3d V_scaled = scale.asDiagonal() * V;
    SharedRelief shared{V_scaled * values.asDiagonal() * V_scaled.transpose(),
                        Eigen::Matrix2d::Zero(), 0.0};
    const auto ofSlopes = [](const Eigen::Matrix3d& sum) -> Eigen::Matrix2d {
      return sum.topLeftCorner<2, 2>();
    };
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> slopes(ofSlopes(H));
    double power = 0.0;
    for (int d = 0; d < 2; ++d) {
      const Eigen::Vector2d v = slopes.eigenvectors().col(d);
      if (!isCoherent(v, ofSlopes(H), ofSlopes(power_there), ofSlopes(power_here))) continue;
      shared.told += v * v.transpose();
      shared.share += slopes.eigenvalues()(d);
      power += v.dot(ofSlopes(power_there) * v);
    }
    if (power > 0.0) shared.share = std::min(1.0, shared.share / power);
    return shared;
  }

  // Of a mean over beams of log(1 + r^2 / (nu sigma^2)).
  double nats(double mean_cost) const { return nats_per_log_ * mean_cost; }
  double surprise(const Pose2& pose) const {
    return 0.5 * squaredDistance(difference(pose, expected_.pose), expected_.covariance);
  }

  const LocalMap& map_;
  const LocalMap& own_map_;
  const Beams beams_;
  const UncertainPose expected_;
  const RegistrationParams& params_;
  const double scale2_;
  const double nats_per_log_;
  // An information matrix: where the relief tells nothing, a window stays as near to where it is
  // expected as the search does.
  const Eigen::Matrix3d held_;
};

}  // namespace

const char* nameOf(Verdict verdict) {
  switch (verdict) {
    case Verdict::kAccepted:
      return "accepted";
    case Verdict::kLittleOverlap:
      return "little_overlap";
    case Verdict::kBadFit:
      return "bad_fit";
    case Verdict::kFlat:
      return "flat";
    case Verdict::kAmbiguous:
      return "ambiguous";
  }
  return "";
}

Registration registerWindow(const LocalMap& map, const WindowOfPings& window,
                            const UncertainPose& expected, const RegistrationParams& params) {
  const Registrar registrar(map, window, expected, params);
  Registration result = registrar.run();
  if (result.verdict != Verdict::kAmbiguous || registrar.isExpected(result.found)) return result;
  // The odometry may be worse than it is said to be: a current, say. What lies so far off must fit
  // well, and be the only such place in a wider search.
  const UncertainPose wider{expected.pose, kWider * kWider * expected.covariance};
  result = Registrar(map, window, wider, params).run();
  if (result.verdict == Verdict::kAccepted && result.rms_m > kGoodFit * map.noise_std_m()) {
    result.verdict = Verdict::kAmbiguous;
  }
  return result;
}

}  // namespace rbpf_core::smoothing
