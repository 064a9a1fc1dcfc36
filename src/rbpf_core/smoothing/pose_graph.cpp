#include "rbpf_core/smoothing/pose_graph.hpp"

#include <ceres/ceres.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <set>
#include <stdexcept>
#include <string>

#include "rbpf_core/rigid.hpp"

namespace rbpf_core::smoothing {

namespace {

// Of survey, over which the biases are taken to be constant.
constexpr double kBiasPeriod_s = 60.0;
// Floors of standard deviations, so that what is known exactly can be weighted.
constexpr double kLeastStd_m = 1e-3;
constexpr double kLeastStd_rad = 1e-4;
// c^2 of the robust kernel of closures and fixes: w = 1 / (1 + chi^2 / c^2).
constexpr double kKernel2 = 6.0;
constexpr int kIterations = 30;

template <typename T>
T wrapped(const T& angle) {
  using std::floor;
  return angle - T(2.0 * M_PI) * floor((angle + T(M_PI)) / T(2.0 * M_PI));
}

// Of pose b in the frame of pose a.
template <typename T>
Eigen::Matrix<T, 3, 1> relativeOf(const T* a, const T* b) {
  using std::cos;
  using std::sin;
  const T c = cos(a[2]);
  const T s = sin(a[2]);
  const T dx = b[0] - a[0];
  const T dy = b[1] - a[1];
  return {c * dx + s * dy, -s * dx + c * dy, b[2] - a[2]};
}

template <int kRows>
Eigen::Matrix<double, kRows, kRows> rootInformation(
    const Eigen::Matrix<double, kRows, kRows>& covariance) {
  const Eigen::LLT<Eigen::Matrix<double, kRows, kRows>> llt(covariance);
  if (!covariance.allFinite() || llt.info() != Eigen::Success) {
    throw std::invalid_argument("covariance is not positive definite");
  }
  const Eigen::Matrix<double, kRows, kRows> L = llt.matrixL();
  return L.inverse();
}

// Two poses, and the odometry's increment between them: with its bias, and without the current.
struct OdometryError {
  Eigen::Vector3d moved;
  double duration_s;
  Eigen::Matrix3d root_information;

  template <typename T>
  bool operator()(const T* from, const T* to, const T* bias, T* residual) const {
    Eigen::Map<Eigen::Matrix<T, 3, 1>> r(residual);
    const Eigen::Matrix<T, 3, 1> truth = relativeOf(from, to);
    // in the heading halfway through the turn
    const double c = std::cos(0.5 * moved.z());
    const double s = std::sin(0.5 * moved.z());
    using std::cos;
    using std::sin;
    const T c_from = cos(from[2]);
    const T s_from = sin(from[2]);
    const T flow_x = c_from * bias[3] + s_from * bias[4];
    const T flow_y = c_from * bias[4] - s_from * bias[3];
    r << truth(0) - moved.x() + (c * bias[0] - s * bias[1] - flow_x) * duration_s,
        truth(1) - moved.y() + (s * bias[0] + c * bias[1] - flow_y) * duration_s,
        wrapped(T(truth(2) - moved.z() + bias[2] * duration_s));
    r = root_information.cast<T>() * r;
    return true;
  }
};

struct RelativePoseError {
  Eigen::Vector3d relative;
  Eigen::Matrix3d root_information;

  template <typename T>
  bool operator()(const T* from, const T* to, T* residual) const {
    Eigen::Map<Eigen::Matrix<T, 3, 1>> r(residual);
    r = relativeOf(from, to) - relative.cast<T>();
    r(2) = wrapped(r(2));
    r = root_information.cast<T>() * r;
    return true;
  }
};

struct PoseError {
  Eigen::Vector3d pose;
  Eigen::Vector3d std;

  template <typename T>
  bool operator()(const T* x, T* residual) const {
    for (int k = 0; k < 3; ++k) residual[k] = x[k] - T(pose[k]);
    residual[2] = wrapped(residual[2]);
    for (int k = 0; k < 3; ++k) residual[k] /= T(std[k]);
    return true;
  }
};

struct HeadingError {
  double yaw_rad;
  double std_rad;

  template <typename T>
  bool operator()(const T* pose, T* residual) const {
    residual[0] = wrapped(T(pose[2] - yaw_rad)) / T(std_rad);
    return true;
  }
};

struct PositionError {
  Eigen::Vector2d position_m;
  Eigen::Vector2d lever_m;
  Eigen::Matrix2d root_information;

  template <typename T>
  bool operator()(const T* pose, T* residual) const {
    using std::cos;
    using std::sin;
    Eigen::Map<Eigen::Matrix<T, 2, 1>> r(residual);
    const T c = cos(pose[2]);
    const T s = sin(pose[2]);
    const Eigen::Matrix<T, 2, 1> at(pose[0] + c * lever_m.x() - s * lever_m.y(),
                                    pose[1] + s * lever_m.x() + c * lever_m.y());
    r = root_information.cast<T>() * (at - position_m.cast<T>());
    return true;
  }
};

// b' = a b + noise: forgets the past within the bias time, and keeps its variance.
struct BiasError {
  double kept;
  Eigen::Matrix<double, 5, 1> std;

  template <typename T>
  bool operator()(const T* from, const T* to, T* residual) const {
    for (int k = 0; k < 5; ++k) residual[k] = (to[k] - T(kept) * from[k]) / T(std[k]);
    return true;
  }
};

struct FirstBiasError {
  Eigen::Matrix<double, 5, 1> std;

  template <typename T>
  bool operator()(const T* bias, T* residual) const {
    for (int k = 0; k < 5; ++k) residual[k] = bias[k] / T(std[k]);
    return true;
  }
};

void expectAtLeast(const char* name, double value, double least) {
  if (std::isfinite(value) && value >= least) return;
  throw std::invalid_argument(std::string(name) + " is " + std::to_string(value) +
                              "; expected a finite number from " + std::to_string(least));
}

Eigen::Vector3d vectorOf(const Pose2& pose) { return {pose.x_m, pose.y_m, pose.yaw_rad}; }

Eigen::Matrix<double, 5, 1> biasStd(const SmoothingParams& params) {
  const double velocity_mps = std::max(params.velocity_bias_std_mps, 1e-9);
  const double current_mps = std::max(params.current_std_mps, 1e-9);
  return {velocity_mps, velocity_mps, std::max(params.yaw_bias_std_radps, 1e-12), current_mps,
          current_mps};
}

// Of an increment. A heading that wanders bends the way there: over a straight one of length L the
// wander's variance v per way makes L^2 v / 3 across, in part with the heading's own.
Eigen::Matrix3d covarianceOf(const Pose2& moved, double duration_s, const MotionNoise& noise) {
  const double across_m = std::hypot(moved.x_m, moved.y_m);
  const double yaw2 =
      std::max(noise.yaw_std_rad * noise.yaw_std_rad * duration_s, kLeastStd_rad * kLeastStd_rad);
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  const double floor2 = kLeastStd_m * kLeastStd_m;
  covariance(0, 0) = std::max(noise.surge_std_m * noise.surge_std_m * duration_s, floor2);
  covariance(1, 1) = std::max(noise.sway_std_m * noise.sway_std_m * duration_s, floor2);
  covariance(2, 2) = yaw2;
  if (across_m > 0.0) {
    const Eigen::Vector2d aside(-moved.y_m, moved.x_m);  // a turn moves the end there
    covariance.topLeftCorner<2, 2>() += yaw2 / 3.0 * aside * aside.transpose();
    covariance.topRightCorner<2, 1>() += yaw2 / 2.0 * aside;
    covariance.bottomLeftCorner<1, 2>() = covariance.topRightCorner<2, 1>().transpose();
  }
  return covariance;
}

}  // namespace

struct PoseGraph::Closure {
  RelativePoseError error;
  std::size_t k, j;
  ceres::ResidualBlockId block;
};

struct PoseGraph::Fix {
  PositionError error;
  std::size_t node;
  ceres::ResidualBlockId block;
  bool may_be_wrong;
};

// ---- what is known ---------------------------------------------------------------------------

PoseGraph::PoseGraph(const SmoothingParams& params, double stamp_s, const Pose2& start)
    : params_(params),
      origin_m_(start.x_m, start.y_m),
      problem_(std::make_unique<ceres::Problem>()) {
  expectAtLeast("smoothing/velocity_bias_std_mps", params.velocity_bias_std_mps, 0.0);
  expectAtLeast("smoothing/yaw_bias_std_radps", params.yaw_bias_std_radps, 0.0);
  expectAtLeast("smoothing/current_std_mps", params.current_std_mps, 0.0);
  expectAtLeast("smoothing/bias_time_s", params.bias_time_s, 1.0);
  expectAtLeast("smoothing/start_position_std_m", params.start_position_std_m, 0.0);
  expectAtLeast("smoothing/start_yaw_std_rad", params.start_yaw_std_rad, 0.0);
  addBias(stamp_s);
  poses_.push_back(fromOrigin(start));
  stamps_s_.push_back(stamp_s);
  bias_of_node_.push_back(0);
  const double position_std_m = std::max(params.start_position_std_m, kLeastStd_m);
  const double yaw_std_rad = std::max(params.start_yaw_std_rad, kLeastStd_rad);
  problem_->AddResidualBlock(
      new ceres::AutoDiffCostFunction<PoseError, 3, 3>(new PoseError{
          poses_.back(), Eigen::Vector3d(position_std_m, position_std_m, yaw_std_rad)}),
      nullptr, poses_.back().data());
}

PoseGraph::~PoseGraph() = default;

void PoseGraph::addBias(double stamp_s) {
  const BiasBlock std = biasStd(params_);
  if (biases_.empty()) {
    biases_.push_back(BiasBlock::Zero());
    problem_->AddResidualBlock(
        new ceres::AutoDiffCostFunction<FirstBiasError, 5, 5>(new FirstBiasError{std}), nullptr,
        biases_.back().data());
  } else {
    const double kept = std::exp(-(stamp_s - bias_stamps_s_.back()) / params_.bias_time_s);
    biases_.push_back(kept * biases_.back());
    problem_->AddResidualBlock(new ceres::AutoDiffCostFunction<BiasError, 5, 5, 5>(new BiasError{
                                   kept, std * std::sqrt(std::max(1.0 - kept * kept, 1e-12))}),
                               nullptr, biases_[biases_.size() - 2].data(), biases_.back().data());
  }
  bias_stamps_s_.push_back(stamp_s);
}

void PoseGraph::addNode(double stamp_s, const Pose2& moved) {
  const double duration_s = stamp_s - stamps_s_.back();
  if (!(duration_s >= 0.0)) {
    throw std::invalid_argument("node of stamp " + std::to_string(stamp_s) +
                                " s; expected none earlier than the node before, " +
                                std::to_string(stamps_s_.back()) + " s");
  }
  if (stamps_s_.back() - bias_stamps_s_.back() >= kBiasPeriod_s) addBias(stamps_s_.back());
  const std::size_t from = poses_.size() - 1;
  poses_.push_back(Block::Zero());
  stamps_s_.push_back(stamp_s);
  bias_of_node_.push_back(biases_.size() - 1);
  const Eigen::Matrix3d covariance = covarianceOf(moved, duration_s, params_.motion);
  problem_->AddResidualBlock(
      new ceres::AutoDiffCostFunction<OdometryError, 3, 3, 3, 5>(
          new OdometryError{vectorOf(moved), duration_s, rootInformation<3>(covariance)}),
      nullptr, poses_[from].data(), poses_.back().data(), biases_.back().data());
  // where the odometry puts it, without its bias, and the current takes it
  const BiasBlock& bias = biases_.back();
  const double c = std::cos(0.5 * moved.yaw_rad);
  const double s = std::sin(0.5 * moved.yaw_rad);
  const Pose2 unbiased{moved.x_m - (c * bias[0] - s * bias[1]) * duration_s,
                       moved.y_m - (s * bias[0] + c * bias[1]) * duration_s,
                       moved.yaw_rad - bias[2] * duration_s};
  poses_.back() = fromOrigin(compose(pose(from), unbiased));
  poses_.back().head<2>() += bias.tail<2>() * duration_s;
}

std::size_t PoseGraph::addClosure(std::size_t k, std::size_t j, const UncertainPose& relative) {
  if (k == j) throw std::invalid_argument("closure of node " + std::to_string(k) + " with itself");
  const RelativePoseError error{vectorOf(relative.pose), rootInformation<3>(relative.covariance)};
  const auto block = problem_->AddResidualBlock(
      new ceres::AutoDiffCostFunction<RelativePoseError, 3, 3, 3>(new RelativePoseError(error)),
      new ceres::CauchyLoss(std::sqrt(kKernel2)), poses_.at(k).data(), poses_.at(j).data());
  closures_.push_back({error, k, j, block});
  return closures_.size() - 1;
}

void PoseGraph::clearClosures() {
  for (const Closure& closure : closures_) problem_->RemoveResidualBlock(closure.block);
  closures_.clear();
}

std::size_t PoseGraph::addFix(std::size_t i, const Eigen::Vector2d& position_m,
                              const Eigen::Matrix2d& covariance_m2, const Eigen::Vector2d& lever_m,
                              bool may_be_wrong) {
  const PositionError error{position_m - origin_m_, lever_m, rootInformation<2>(covariance_m2)};
  const auto block = problem_->AddResidualBlock(
      new ceres::AutoDiffCostFunction<PositionError, 2, 3>(new PositionError(error)),
      may_be_wrong ? new ceres::CauchyLoss(std::sqrt(kKernel2)) : nullptr, poses_.at(i).data());
  fixes_.push_back({error, i, block, may_be_wrong});
  return fixes_.size() - 1;
}

void PoseGraph::addHeading(std::size_t i, double yaw_rad, double variance_rad2) {
  problem_->AddResidualBlock(new ceres::AutoDiffCostFunction<HeadingError, 1, 3>(
                                 new HeadingError{yaw_rad, std::sqrt(variance_rad2)}),
                             nullptr, poses_.at(i).data());
}

// ---- what follows from it ----------------------------------------------------------------------

void PoseGraph::solve() {
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  // CHOLMOD starts the threads of its BLAS, for blocks far too small for that.
  options.sparse_linear_algebra_library_type = ceres::EIGEN_SPARSE;
  options.max_num_iterations = kIterations;
  options.function_tolerance = 1e-5;
  options.num_threads = 1;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, problem_.get(), &summary);
  if (!summary.IsSolutionUsable()) throw std::runtime_error("pose graph: " + summary.message);
}

PoseGraph::Block PoseGraph::fromOrigin(const Pose2& pose) const {
  return {pose.x_m - origin_m_.x(), pose.y_m - origin_m_.y(), pose.yaw_rad};
}

Pose2 PoseGraph::pose(std::size_t i) const {
  const Block& x = poses_.at(i);
  return {x[0] + origin_m_.x(), x[1] + origin_m_.y(), wrapAngle(x[2])};
}

std::vector<Pose2> PoseGraph::poses() const {
  std::vector<Pose2> poses;
  for (std::size_t i = 0; i < size(); ++i) poses.push_back(pose(i));
  return poses;
}

MotionBias PoseGraph::biasAt(std::size_t i) const {
  const BiasBlock& bias = biases_[bias_of_node_.at(i)];
  return {bias[0], bias[1], bias[2], bias[3], bias[4]};
}

MotionBias PoseGraph::bias() const { return biasAt(size() - 1); }

double PoseGraph::weightOfClosure(std::size_t closure) const {
  const Closure& c = closures_.at(closure);
  Eigen::Vector3d residual;
  c.error(poses_[c.k].data(), poses_[c.j].data(), residual.data());
  return 1.0 / (1.0 + residual.squaredNorm() / kKernel2);
}

double PoseGraph::weightOfFix(std::size_t fix) const {
  const Fix& f = fixes_.at(fix);
  if (!f.may_be_wrong) return 1.0;
  Eigen::Vector2d residual;
  f.error(poses_[f.node].data(), residual.data());
  return 1.0 / (1.0 + residual.squaredNorm() / kKernel2);
}

// ---- how well it is known ----------------------------------------------------------------------

PoseGraph::Covariances::Covariances(const PoseGraph& graph, double share_of_closures)
    : graph_(graph) {
  std::set<ceres::ResidualBlockId> closures;
  for (const Closure& closure : graph.closures_) closures.insert(closure.block);
  ceres::Problem::EvaluateOptions options;
  graph.problem_->GetResidualBlocks(&options.residual_blocks);
  const auto first_closure = std::stable_partition(
      options.residual_blocks.begin(), options.residual_blocks.end(),
      [&](ceres::ResidualBlockId block) { return closures.count(block) == 0; });
  for (const Block& pose : graph.poses_) {
    options.parameter_blocks.push_back(const_cast<double*>(pose.data()));
  }
  for (const BiasBlock& bias : graph.biases_) {
    options.parameter_blocks.push_back(const_cast<double*>(bias.data()));
  }
  ceres::CRSMatrix jacobian;
  graph.problem_->Evaluate(options, nullptr, nullptr, nullptr, &jacobian);
  // rows of closures are the last ones
  const auto rows = 3 * std::distance(first_closure, options.residual_blocks.end());
  for (int i = jacobian.rows[jacobian.num_rows - rows]; i < jacobian.rows.back(); ++i) {
    jacobian.values[i] *= std::sqrt(share_of_closures);
  }
  const Eigen::Map<const Eigen::SparseMatrix<double, Eigen::RowMajor>> J(
      jacobian.num_rows, jacobian.num_cols, static_cast<Eigen::Index>(jacobian.values.size()),
      jacobian.rows.data(), jacobian.cols.data(), jacobian.values.data());
  const Eigen::SparseMatrix<double> H = J.transpose() * J;
  factor_.compute(H);
  if (factor_.info() != Eigen::Success) {
    throw std::runtime_error("pose graph: its information matrix is not positive definite");
  }
}

Eigen::Matrix3d PoseGraph::Covariances::of(std::size_t i) const {
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(factor_.rows(), 3);
  A.middleRows<3>(graph_.firstColumn(i)).setIdentity();
  return ofLinear(std::move(A));
}

Eigen::Matrix3d PoseGraph::Covariances::ofRelative(std::size_t k, std::size_t j) const {
  // The relative pose is A (x_k, x_j) near the solution.
  const Pose2 a = graph_.pose(k);
  const Pose2 in_k = relative(a, graph_.pose(j));
  const double c = std::cos(a.yaw_rad);
  const double s = std::sin(a.yaw_rad);
  Eigen::Matrix3d to_k;
  Eigen::Matrix3d to_j;
  to_j << c, s, 0.0, -s, c, 0.0, 0.0, 0.0, 1.0;
  to_k = -to_j;
  to_k(0, 2) = in_k.y_m;
  to_k(1, 2) = -in_k.x_m;
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(factor_.rows(), 3);
  A.middleRows<3>(graph_.firstColumn(k)) = to_k.transpose();
  A.middleRows<3>(graph_.firstColumn(j)) += to_j.transpose();
  return ofLinear(std::move(A));
}

// H = P^T L L^T P, so that A^T H^-1 A = |L^-1 P A|^2. A has few entries, and L^-1 spreads them
// along one path of the elimination tree each: solving with H as a whole would go through all of L,
// twice.
Eigen::Matrix3d PoseGraph::Covariances::ofLinear(Eigen::MatrixXd A) const {
  if (factor_.permutationP().size() > 0) A = factor_.permutationP() * A;
  factor_.matrixL().solveInPlace(A);
  return A.transpose() * A;
}

}  // namespace rbpf_core::smoothing
