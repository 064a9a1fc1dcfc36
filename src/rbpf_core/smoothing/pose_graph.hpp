// What is known of the track, as a sparse least-squares problem: Ceres solves it.
#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCholesky>
#include <deque>
#include <memory>
#include <vector>

#include "rbpf_core/past_correction.hpp"
#include "rbpf_core/smoothing/registration.hpp"
#include "rbpf_core/smoothing/smoothing_params.hpp"

namespace ceres {
class Problem;
}

namespace rbpf_core::smoothing {

// Poses at nodes, and the odometry's biases, which are constant over a minute. Known of
// them: where the track starts; what the odometry says between one node and the next; relative
// poses of any two nodes (closures); places of single nodes (fixes).
class PoseGraph {
 public:
  // Throws std::invalid_argument that names a parameter which is out of range.
  PoseGraph(const SmoothingParams& params, double stamp_s, const Pose2& start);
  ~PoseGraph();

  // The next node, `moved` further by the odometry; it goes on from the one before, without bias.
  // Stamps must not go back.
  void addNode(double stamp_s, const Pose2& moved);

  // Of node j in the frame of node k. Returns the closure's number. Throws std::invalid_argument if
  // both are one, or if the covariance is not positive definite.
  std::size_t addClosure(std::size_t k, std::size_t j, const UncertainPose& relative);
  void clearClosures();

  // Of a point in node i's frame, in map; the node's yaw is told only by way of it. One that may be
  // wrong counts the less the worse it fits. Returns the fix's number.
  std::size_t addFix(std::size_t i, const Eigen::Vector2d& position_m,
                     const Eigen::Matrix2d& covariance_m2,
                     const Eigen::Vector2d& lever_m = Eigen::Vector2d::Zero(),
                     bool may_be_wrong = true);
  // Of node i in map; it is believed.
  void addHeading(std::size_t i, double yaw_rad, double variance_rad2);

  void solve();

  std::size_t size() const { return poses_.size(); }
  Pose2 pose(std::size_t i) const;
  std::vector<Pose2> poses() const;
  MotionBias bias() const;  // at the last node
  MotionBias biasAt(std::size_t i) const;

  // How much a closure or a fix counts at the solution, 1: fully. w = 1 / (1 + chi^2 / c^2).
  double weightOfClosure(std::size_t closure) const;
  double weightOfFix(std::size_t fix) const;

  // Covariances at the solution, as if it were linear there.
  class Covariances {
   public:
    // Closures count as so much of what they say: 1 if each errs on its own, less if some err
    // alike.
    explicit Covariances(const PoseGraph& graph, double share_of_closures = 1.0);
    // Of x, y, yaw in map.
    Eigen::Matrix3d of(std::size_t i) const;
    // Of node j in the frame of node k.
    Eigen::Matrix3d ofRelative(std::size_t k, std::size_t j) const;

   private:
    // Of A^T x, x all of the graph's unknowns.
    Eigen::Matrix3d ofLinear(Eigen::MatrixXd A) const;

    const PoseGraph& graph_;
    Eigen::SimplicialLLT<Eigen::SparseMatrix<double>> factor_;
  };

 private:
  using Block = Eigen::Vector3d;                  // x, y, yaw
  using BiasBlock = Eigen::Matrix<double, 5, 1>;  // surge, sway, yaw rate; current in map

  struct Closure;
  struct Fix;

  void addBias(double stamp_s);
  int firstColumn(std::size_t node) const { return 3 * static_cast<int>(node); }

  Block fromOrigin(const Pose2& pose) const;

  const SmoothingParams params_;
  // Where the track starts. Poses count from here: the solver stops where its steps are small
  // against what it solves for, which coordinates of a projection would make large.
  const Eigen::Vector2d origin_m_;
  // In deques: their addresses stay.
  std::deque<Block> poses_;
  std::vector<double> stamps_s_;
  std::deque<BiasBlock> biases_;
  std::vector<double> bias_stamps_s_;
  std::vector<std::size_t> bias_of_node_;
  std::vector<Closure> closures_;
  std::vector<Fix> fixes_;
  std::unique_ptr<ceres::Problem> problem_;
};

}  // namespace rbpf_core::smoothing
