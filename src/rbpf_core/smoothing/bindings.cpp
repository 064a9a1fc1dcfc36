// The Python module rbpf_svgp_slam._smoothing: the smoother for surveys that are over, and its
// graph for those who know better closures. Poses are rows of x, y (m) and yaw (rad).
#include <pybind11/eigen.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <optional>
#include <utility>

#include "rbpf_core/smoothing/smoother.hpp"

namespace py = pybind11;

namespace rbpf_core::smoothing {

namespace {

using Unlocked = py::call_guard<py::gil_scoped_release>;
using Rows3f = Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor>;
using Rows3 = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;

Pose2 toPose(const Eigen::Vector3d& row) { return {row[0], row[1], row[2]}; }
Eigen::Vector3d toRow(const Pose2& pose) { return {pose.x_m, pose.y_m, pose.yaw_rad}; }

Rows3 toRows(const std::vector<Pose2>& poses) {
  Rows3 rows(static_cast<Eigen::Index>(poses.size()), 3);
  for (std::size_t i = 0; i < poses.size(); ++i)
    rows.row(static_cast<Eigen::Index>(i)) = toRow(poses[i]);
  return rows;
}

Eigen::Matrix<double, 5, 1> toVector(const MotionBias& bias) {
  return {bias.surge_mps, bias.sway_mps, bias.yaw_radps, bias.current_x_mps, bias.current_y_mps};
}

py::dict toDict(const Closure& closure) {
  const Registration& registration = closure.registration;
  py::dict fields;
  fields["node"] = closure.j;
  fields["node_older"] = closure.k;
  fields["stamp"] = closure.stamp_s;
  fields["stamp_older"] = closure.stamp_older_s;
  fields["expected"] = toRow(closure.expected);
  fields["relative"] = toRow(registration.found.pose);
  fields["covariance"] = registration.found.covariance;
  fields["shift"] = closure.shift;
  fields["rms_m"] = registration.rms_m;
  fields["beams"] = registration.beams;
  fields["weight"] = closure.weight;
  fields["verdict"] = nameOf(registration.verdict);
  return fields;
}

void addPings(Smoother& smoother, const Eigen::VectorXd& stamps_s, const Rows3& dead_reckoning,
              const Rows3f& beams_m, const std::vector<std::size_t>& beams_of_ping) {
  std::size_t total = 0;
  for (const std::size_t beams : beams_of_ping) total += beams;
  if (dead_reckoning.rows() != stamps_s.size() ||
      static_cast<Eigen::Index>(beams_of_ping.size()) != stamps_s.size() ||
      static_cast<Eigen::Index>(total) != beams_m.rows()) {
    throw std::invalid_argument(
        std::to_string(stamps_s.size()) + " stamps, " + std::to_string(dead_reckoning.rows()) +
        " poses, " + std::to_string(beams_of_ping.size()) + " numbers of beams that add up to " +
        std::to_string(total) + ", and " + std::to_string(beams_m.rows()) +
        " beams; expected one of each for every ping, and as many beams as they add up to");
  }
  Eigen::Index first = 0;
  for (Eigen::Index i = 0; i < stamps_s.size(); ++i) {
    const auto beams = static_cast<Eigen::Index>(beams_of_ping[static_cast<std::size_t>(i)]);
    smoother.addPing(stamps_s[i], toPose(dead_reckoning.row(i)),
                     beams_m.middleRows(first, beams).transpose());
    first += beams;
  }
}

void addFix(Smoother& smoother, double stamp_s, const Eigen::Vector2d& position_m,
            const Eigen::Matrix2d& covariance_m2, const Eigen::Vector3d& dead_reckoning,
            std::optional<std::pair<double, double>> heading) {
  FixRecord record{{stamp_s, position_m, covariance_m2}, toPose(dead_reckoning)};
  if (heading) record.fix.heading = Heading{heading->first, heading->second};
  smoother.addFix(record);
}

}  // namespace

PYBIND11_MODULE(_smoothing, m) {
  m.doc() = "Smoothing of the past: windows of pings registered to older passes, and a pose graph.";

  py::class_<RegistrationParams>(m, "RegistrationParams")
      .def(py::init<>())
      .def_readwrite("node_period_s", &RegistrationParams::node_period_s)
      .def_readwrite("window_s", &RegistrationParams::window_s)
      .def_readwrite("map_window_s", &RegistrationParams::map_window_s)
      .def_readwrite("min_apart_s", &RegistrationParams::min_apart_s)
      .def_readwrite("passes", &RegistrationParams::passes)
      .def_readwrite("effective_beams", &RegistrationParams::effective_beams)
      .def_readwrite("max_search_m", &RegistrationParams::max_search_m);

  py::class_<MotionNoise>(m, "MotionNoise")
      .def(py::init<>())
      .def_readwrite("surge_std_m", &MotionNoise::surge_std_m)
      .def_readwrite("sway_std_m", &MotionNoise::sway_std_m)
      .def_readwrite("yaw_std_rad", &MotionNoise::yaw_std_rad);

  py::class_<SmoothingParams>(m, "SmoothingParams")
      .def(py::init<>())
      .def_readwrite("motion", &SmoothingParams::motion)
      .def_readwrite("velocity_bias_std_mps", &SmoothingParams::velocity_bias_std_mps)
      .def_readwrite("yaw_bias_std_radps", &SmoothingParams::yaw_bias_std_radps)
      .def_readwrite("current_std_mps", &SmoothingParams::current_std_mps)
      .def_readwrite("bias_time_s", &SmoothingParams::bias_time_s)
      .def_readwrite("start_position_std_m", &SmoothingParams::start_position_std_m)
      .def_readwrite("start_yaw_std_rad", &SmoothingParams::start_yaw_std_rad)
      .def_readwrite("registration", &SmoothingParams::registration);

  py::class_<Smoother>(m, "Smoother")
      .def(
          py::init([](const SmoothingParams& params, double stamp_s, const Eigen::Vector3d& start) {
            return std::make_unique<Smoother>(params, stamp_s, toPose(start));
          }),
          py::arg("params"), py::arg("stamp_s"), py::arg("start"))
      .def("add_pings", &addPings, py::arg("stamps_s"), py::arg("dead_reckoning"),
           py::arg("beams_m"), py::arg("beams_of_ping"), Unlocked())
      .def("add_fix", &addFix, py::arg("stamp_s"), py::arg("position_m"), py::arg("covariance_m2"),
           py::arg("dead_reckoning"), py::arg("heading") = py::none(),
           "heading: yaw, rad, and its variance, rad^2.")
      .def("finish_pings", &Smoother::finishPings, Unlocked())
      .def("update", &Smoother::update, Unlocked())
      .def("register_again", &Smoother::registerAgain, Unlocked())
      .def_property_readonly("poses", [](const Smoother& s) { return toRows(s.posesOfPings()); })
      .def_property_readonly(
          "covariances",
          [](const Smoother& s) {
            const auto of_pings = s.covariancesOfPings();
            py::array_t<double> out({of_pings.size(), std::size_t{3}, std::size_t{3}});
            auto view = out.mutable_unchecked<3>();
            for (std::size_t i = 0; i < of_pings.size(); ++i)
              for (int a = 0; a < 3; ++a)
                for (int b = 0; b < 3; ++b) view(i, a, b) = of_pings[i](a, b);
            return out;
          })
      .def_property_readonly("closures",
                             [](const Smoother& s) {
                               py::list all;
                               for (const Closure& closure : s.closures())
                                 all.append(toDict(closure));
                               return all;
                             })
      .def_property_readonly("bias", [](const Smoother& s) { return toVector(s.graph().bias()); });

  py::class_<PoseGraph>(m, "PoseGraph")
      .def(
          py::init([](const SmoothingParams& params, double stamp_s, const Eigen::Vector3d& start) {
            return std::make_unique<PoseGraph>(params, stamp_s, toPose(start));
          }),
          py::arg("params"), py::arg("stamp_s"), py::arg("start"))
      .def("add_node", [](PoseGraph& graph, double stamp_s,
                          const Eigen::Vector3d& moved) { graph.addNode(stamp_s, toPose(moved)); })
      .def("add_closure",
           [](PoseGraph& graph, std::size_t k, std::size_t j, const Eigen::Vector3d& relative,
              const Eigen::Matrix3d& covariance) {
             return graph.addClosure(k, j, {toPose(relative), covariance});
           })
      .def("add_fix", &PoseGraph::addFix, py::arg("node"), py::arg("position_m"),
           py::arg("covariance_m2"), py::arg("lever_m") = Eigen::Vector2d(0.0, 0.0),
           py::arg("may_be_wrong") = true)
      .def("solve", &PoseGraph::solve, Unlocked())
      .def("weight_of_closure", &PoseGraph::weightOfClosure)
      .def_property_readonly("poses", [](const PoseGraph& graph) { return toRows(graph.poses()); })
      .def("pose", [](const PoseGraph& graph, std::size_t i) { return toRow(graph.pose(i)); })
      .def("covariance", [](const PoseGraph& graph,
                            std::size_t i) { return PoseGraph::Covariances(graph).of(i); })
      .def("relative_covariance",
           [](const PoseGraph& graph, std::size_t k, std::size_t j) {
             return PoseGraph::Covariances(graph).ofRelative(k, j);
           })
      .def_property_readonly("bias", [](const PoseGraph& graph) { return toVector(graph.bias()); });
}

}  // namespace rbpf_core::smoothing
