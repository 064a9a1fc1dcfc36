// The pose graph written out with dense matrices and numerical derivatives: what the library is
// held against.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <vector>

#include "rbpf_core/rigid.hpp"
#include "rbpf_core/smoothing/registration.hpp"
#include "rbpf_core/smoothing/smoothing_params.hpp"

namespace rbpf_core::smoothing {

struct GivenClosure {
  std::size_t k, j;
  UncertainPose relative;
};

struct GivenFix {
  std::size_t node;
  Eigen::Vector2d position_m;
  Eigen::Matrix2d covariance_m2;
};

// What is known of a track. moved[i] goes from node i to node i + 1.
struct GivenTrack {
  std::vector<double> stamps_s;
  Pose2 start;
  std::vector<Pose2> moved;
  std::vector<GivenClosure> closures;
  std::vector<GivenFix> fixes;
};

// Unknown are x, y, yaw of every node, then surge, sway, yaw rate and current of every bias, one
// for each started minute: iterated to convergence with weights 1 / (1 + chi^2 / 6) of closures and
// fixes.
class DenseGraph {
 public:
  // Covariances are those of closures that count for this share of what they say.
  DenseGraph(const SmoothingParams& params, const GivenTrack& given, double share_of_closures = 1.0)
      : params_(params), given_(given) {
    std::vector<Pose2> poses{given.start};
    bias_of_.push_back(0);
    bias_stamps_s_.push_back(given.stamps_s.front());
    for (std::size_t i = 0; i < given.moved.size(); ++i) {
      if (given.stamps_s[i] - bias_stamps_s_.back() >= 60.0) {
        bias_stamps_s_.push_back(given.stamps_s[i]);
      }
      bias_of_.push_back(bias_stamps_s_.size() - 1);
      poses.push_back(compose(poses.back(), given.moved[i]));
      whitenings_.push_back(whitening(i));
    }
    x_ = Eigen::VectorXd::Zero(
        static_cast<Eigen::Index>(3 * poses.size() + 5 * bias_stamps_s_.size()));
    for (std::size_t i = 0; i < poses.size(); ++i) {
      x_.segment<3>(3 * static_cast<Eigen::Index>(i)) << poses[i].x_m, poses[i].y_m,
          poses[i].yaw_rad;
    }
    for (int iteration = 0; iteration < 200; ++iteration) {
      linearise();
      const Eigen::VectorXd step =
          -(J_.transpose() * J_).ldlt().solve(J_.transpose() * weighted(x_));
      x_ += step;
      if (step.cwiseAbs().maxCoeff() < 1e-8) break;
    }
    linearise();
    const auto rows = 3 * static_cast<Eigen::Index>(given.closures.size());
    const Eigen::Index last_row = J_.rows() - 2 * static_cast<Eigen::Index>(given.fixes.size());
    J_.middleRows(last_row - rows, rows) *= std::sqrt(share_of_closures);
    covariance_ =
        (J_.transpose() * J_).ldlt().solve(Eigen::MatrixXd::Identity(x_.size(), x_.size()));
  }

  Pose2 pose(std::size_t i) const {
    const Eigen::Vector3d x = x_.segment<3>(3 * static_cast<Eigen::Index>(i));
    return {x(0), x(1), wrapAngle(x(2))};
  }
  Eigen::VectorXd biasAt(std::size_t i) const { return x_.segment<5>(firstOfBias(bias_of_[i])); }
  double weightOfClosure(std::size_t closure) const { return weights_[closure]; }
  double weightOfFix(std::size_t fix) const { return weights_[given_.closures.size() + fix]; }

  Eigen::Matrix3d covariance(std::size_t i) const {
    const auto at = 3 * static_cast<Eigen::Index>(i);
    return covariance_.block<3, 3>(at, at);
  }

  // By numerical derivatives of the relative pose.
  Eigen::Matrix3d relativeCovariance(std::size_t k, std::size_t j) const {
    Eigen::MatrixXd A(3, x_.size());
    for (Eigen::Index column = 0; column < x_.size(); ++column) {
      const auto at = [&](double step) {
        Eigen::VectorXd x = x_;
        x(column) += step;
        return relativeOf(x, k, j);
      };
      A.col(column) = (at(kStep) - at(-kStep)) / (2.0 * kStep);
    }
    return A * covariance_ * A.transpose();
  }

 private:
  static constexpr double kStep = 1e-5;

  Eigen::Index firstOfBias(std::size_t bias) const {
    return static_cast<Eigen::Index>(3 * given_.stamps_s.size() + 5 * bias);
  }

  Eigen::Vector3d relativeOf(const Eigen::VectorXd& x, std::size_t k, std::size_t j) const {
    const Eigen::Vector3d a = x.segment<3>(3 * static_cast<Eigen::Index>(k));
    const Eigen::Vector3d b = x.segment<3>(3 * static_cast<Eigen::Index>(j));
    const Pose2 in_a = relative({a(0), a(1), a(2)}, {b(0), b(1), b(2)});
    return {in_a.x_m, in_a.y_m, in_a.yaw_rad};
  }

  // Of an increment, by its Cholesky factor.
  Eigen::MatrixXd whitening(std::size_t i) const {
    const Pose2& moved = given_.moved[i];
    const double t = given_.stamps_s[i + 1] - given_.stamps_s[i];
    const MotionNoise& noise = params_.motion;
    const double yaw2 = noise.yaw_std_rad * noise.yaw_std_rad * t;
    const Eigen::Vector3d turned(-moved.y_m, moved.x_m, 0.0);
    const Eigen::Vector3d yaw = Eigen::Vector3d::UnitZ();
    const Eigen::Matrix3d covariance =
        Eigen::Vector3d(noise.surge_std_m * noise.surge_std_m * t,
                        noise.sway_std_m * noise.sway_std_m * t, yaw2)
            .asDiagonal()
            .toDenseMatrix() +
        yaw2 * (turned * turned.transpose() / 3.0 +
                (turned * yaw.transpose() + yaw * turned.transpose()) / 2.0);
    return whiteningOf(covariance);
  }

  template <typename Matrix>
  static Eigen::MatrixXd whiteningOf(const Matrix& covariance) {
    return Eigen::MatrixXd(Eigen::MatrixXd(covariance).llt().matrixL()).inverse();
  }

  // Of one factor each, whitened; those of closures and fixes last.
  std::vector<Eigen::VectorXd> residuals(const Eigen::VectorXd& x) const {
    std::vector<Eigen::VectorXd> r;
    const Eigen::Vector3d start(given_.start.x_m, given_.start.y_m, given_.start.yaw_rad);
    const double position_std_m = std::max(params_.start_position_std_m, 1e-3);
    const double yaw_std_rad = std::max(params_.start_yaw_std_rad, 1e-4);
    r.push_back((x.head<3>() - start)
                    .cwiseQuotient(Eigen::Vector3d(position_std_m, position_std_m, yaw_std_rad)));
    for (std::size_t i = 0; i < given_.moved.size(); ++i) {
      const double t = given_.stamps_s[i + 1] - given_.stamps_s[i];
      const Pose2& moved = given_.moved[i];
      const Eigen::VectorXd bias = t * x.segment<5>(firstOfBias(bias_of_[i + 1]));
      const double c = std::cos(moved.yaw_rad / 2.0);
      const double s = std::sin(moved.yaw_rad / 2.0);
      Eigen::Vector3d e = relativeOf(x, i, i + 1);
      e -= Eigen::Vector3d(moved.x_m - c * bias(0) + s * bias(1),
                           moved.y_m - s * bias(0) - c * bias(1), moved.yaw_rad - bias(2));
      const double yaw = x(3 * static_cast<Eigen::Index>(i) + 2);
      e.head<2>() -= Eigen::Rotation2Dd(-yaw) * bias.tail<2>();
      e(2) = wrapAngle(e(2));
      r.push_back(whitenings_[i] * e);
    }
    Eigen::VectorXd std(5);
    std << params_.velocity_bias_std_mps, params_.velocity_bias_std_mps, params_.yaw_bias_std_radps,
        params_.current_std_mps, params_.current_std_mps;
    for (std::size_t b = 0; b < bias_stamps_s_.size(); ++b) {
      Eigen::VectorXd change = x.segment<5>(firstOfBias(b));
      double kept = 0.0;
      if (b > 0) {
        kept = std::exp(-(bias_stamps_s_[b] - bias_stamps_s_[b - 1]) / params_.bias_time_s);
        change -= kept * x.segment<5>(firstOfBias(b - 1));
      }
      r.push_back(change.cwiseQuotient(std) / std::sqrt(1.0 - kept * kept));
    }
    for (const GivenClosure& closure : given_.closures) {
      const Pose2& measured = closure.relative.pose;
      Eigen::Vector3d e = relativeOf(x, closure.k, closure.j) -
                          Eigen::Vector3d(measured.x_m, measured.y_m, measured.yaw_rad);
      e(2) = wrapAngle(e(2));
      r.push_back(whiteningOf(closure.relative.covariance) * e);
    }
    for (const GivenFix& fix : given_.fixes) {
      const Eigen::Vector2d position = x.segment<2>(3 * static_cast<Eigen::Index>(fix.node));
      r.push_back(whiteningOf(fix.covariance_m2) * (position - fix.position_m));
    }
    return r;
  }

  // All residuals, times the roots of their weights.
  Eigen::VectorXd weighted(const Eigen::VectorXd& x) const {
    const std::vector<Eigen::VectorXd> r = residuals(x);
    Eigen::Index rows = 0;
    for (const Eigen::VectorXd& one : r) rows += one.size();
    Eigen::VectorXd all(rows);
    rows = 0;
    for (std::size_t f = 0; f < r.size(); ++f) {
      const std::size_t first = r.size() - weights_.size();
      all.segment(rows, r[f].size()) = (f < first ? 1.0 : std::sqrt(weights_[f - first])) * r[f];
      rows += r[f].size();
    }
    return all;
  }

  // The weights and derivatives at x_.
  void linearise() {
    weights_.clear();
    const std::vector<Eigen::VectorXd> r = residuals(x_);
    const std::size_t robust = given_.closures.size() + given_.fixes.size();
    for (std::size_t f = r.size() - robust; f < r.size(); ++f) {
      weights_.push_back(1.0 / (1.0 + r[f].squaredNorm() / 6.0));
    }
    const Eigen::Index rows = weighted(x_).size();
    J_.resize(rows, x_.size());
    for (Eigen::Index column = 0; column < x_.size(); ++column) {
      Eigen::VectorXd x = x_;
      x(column) += kStep;
      J_.col(column) = weighted(x);
      x(column) -= 2.0 * kStep;
      J_.col(column) = (J_.col(column) - weighted(x)) / (2.0 * kStep);
    }
  }

  const SmoothingParams params_;
  const GivenTrack given_;
  std::vector<std::size_t> bias_of_;
  std::vector<double> bias_stamps_s_;
  std::vector<Eigen::MatrixXd> whitenings_;  // of increments
  Eigen::VectorXd x_;
  std::vector<double> weights_;  // of closures, then fixes
  Eigen::MatrixXd J_;
  Eigen::MatrixXd covariance_;
};

}  // namespace rbpf_core::smoothing
