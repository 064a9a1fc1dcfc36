// The Python module rbpf_svgp_slam._gmrf. Whatever takes time lets go of the interpreter's
// lock. Arrays of beams and points have one row each, as numpy has them.
#include <pybind11/eigen.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "gmrf/evidence.hpp"
#include "gmrf/many_maps.hpp"
#include "gmrf/map.hpp"
#include "gmrf/map_bytes.hpp"
#include "gmrf/robust_weights.hpp"

namespace py = pybind11;

namespace gmrf {

namespace {

using Rows3 = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;
using Rows2 = Eigen::Matrix<double, Eigen::Dynamic, 2, Eigen::RowMajor>;
using Unlocked = py::call_guard<py::gil_scoped_release>;

Model makeModel(double spacing_m, double lengthscale_m, double outputscale_m2,
                double noise_variance_m2) {
  const Model model{spacing_m, lengthscale_m, outputscale_m2, noise_variance_m2};
  model.check();
  return model;
}

using FloatRows3 = Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor>;

LevelledBlock makeBlock(const FloatRows3& beams_m, const std::vector<std::uint32_t>& ping,
                        std::size_t pings) {
  LevelledBlock block{beams_m.transpose(), ping, pings};
  block.check();
  return block;
}

std::vector<PlacingPose> toPoses(const py::bytes& bytes) {
  const std::string_view raw = bytes;
  if (raw.size() % sizeof(PlacingPose) != 0) {
    throw std::invalid_argument("poses have " + std::to_string(raw.size()) +
                                " bytes; expected a multiple of 24");
  }
  std::vector<PlacingPose> poses(raw.size() / sizeof(PlacingPose));
  std::memcpy(poses.data(), raw.data(), raw.size());
  return poses;
}

void foldInto(const std::vector<Map*>& maps, const LevelledBlock& block, const py::bytes& poses,
              const Eigen::VectorXd& weights) {
  const std::vector<PlacingPose> placing = toPoses(poses);
  const py::gil_scoped_release unlocked;
  foldIntoAll(maps, block, placing, weights);
}

// Each map at its own points [maps, n, 2]: mean and variance, [maps, n].
std::pair<py::array_t<float>, py::array_t<float>> predictEach(
    const std::vector<Map*>& maps,
    const py::array_t<float, py::array::c_style | py::array::forcecast>& points,
    const FieldModel& field) {
  if (points.ndim() != 3 || points.shape(0) != static_cast<py::ssize_t>(maps.size()) ||
      points.shape(2) != 2) {
    throw std::invalid_argument("points are not of shape [maps, n, 2], one row for each of " +
                                std::to_string(maps.size()) + " maps");
  }
  const py::ssize_t n = points.shape(1);
  py::array_t<float> mean({points.shape(0), n});
  py::array_t<float> variance({points.shape(0), n});
  float* means = mean.mutable_data();
  float* variances = variance.mutable_data();
  const float* xy = points.data();
  const py::gil_scoped_release unlocked;
  for (std::size_t m = 0; m < maps.size(); ++m) {
    const auto offset = static_cast<std::ptrdiff_t>(m) * n;
    const Eigen::Map<const Eigen::Matrix2Xf> places(xy + 2 * offset, 2, n);
    const Prediction prediction = maps[m]->predict(places.cast<double>(), field);
    Eigen::Map<Eigen::VectorXf>(means + offset, n) = prediction.mean_m.cast<float>();
    Eigen::Map<Eigen::VectorXf>(variances + offset, n) = prediction.variance_m2.cast<float>();
  }
  return {std::move(mean), std::move(variance)};
}

Sample makeSample(const Rows3& beams, const Eigen::VectorXd& weights) {
  return {beams.transpose(), weights};
}

}  // namespace

PYBIND11_MODULE(_gmrf, module) {
  module.doc() = "Gaussian Markov random fields: see src/gmrf and docs/gmrf.md.";

  py::class_<Model>(module, "Model")
      .def(py::init(&makeModel), py::arg("spacing_m"), py::arg("lengthscale_m"),
           py::arg("outputscale_m2"), py::arg("noise_variance_m2"))
      .def_readonly("spacing_m", &Model::spacing_m)
      .def_readonly("lengthscale_m", &Model::lengthscale_m)
      .def_readonly("outputscale_m2", &Model::outputscale_m2)
      .def_readonly("noise_variance_m2", &Model::noise_variance_m2);

  py::class_<FieldModel>(module, "FieldModel")
      .def(py::init<const Model&>())
      .def_property_readonly("model", &FieldModel::model)
      .def_property_readonly("beam_variance_m2", &FieldModel::beamVariance)
      .def_property_readonly("discretisation_variance_m2",
                             [](const FieldModel& field) { return field.discretisation().mean(); });

  py::class_<Map>(module, "Map")
      .def(py::init<double, double>(), py::arg("spacing_m"), py::arg("reference_m"))
      .def("share", &Map::share)
      .def(
          "fold",
          [](Map& map, const Rows3& beams, const Eigen::VectorXd& weights) {
            map.fold(beams.transpose(), weights);
          },
          Unlocked())
      .def(
          "predict",
          [](const Map& map, const Rows2& points, const FieldModel& field) {
            Prediction prediction = map.predict(points.transpose(), field);
            return std::pair(std::move(prediction.mean_m), std::move(prediction.variance_m2));
          },
          Unlocked())
      .def(
          "robust_weights",
          [](Map& map, const FieldModel& field, const Rows3& beams) {
            return robustWeights(map, field, beams.transpose());
          },
          Unlocked())
      .def("nodes_with_data",
           [](const Map& map) -> Rows2 { return map.nodesWithData().transpose(); })
      .def("tile_middles", [](const Map& map) -> Rows2 { return map.tileMiddles().transpose(); })
      .def_property_readonly("spacing_m", &Map::spacing_m);

  py::class_<LevelledBlock>(module, "LevelledBlock")
      .def(py::init(&makeBlock), py::arg("beams_m"), py::arg("ping"), py::arg("pings"));
  module.def("fold_into_all", &foldInto);
  module.def("predict_each", &predictEach);

  py::class_<KnownTiles>(module, "KnownTiles")
      .def(py::init<>())
      .def(py::init([](const std::vector<std::uint64_t>& hashes) {
        return KnownTiles{{hashes.begin(), hashes.end()}};
      }));
  py::class_<TilePool>(module, "TilePool")
      .def(py::init<>())
      .def_property_readonly("hashes", &TilePool::hashes);
  module.def("to_bytes", [](Map& map, KnownTiles& known, TilePool& pool) {
    return py::bytes(toBytes(map, &known, &pool));
  });
  module.def("from_bytes",
             [](const std::string& bytes, TilePool& pool) { return fromBytes(bytes, &pool); });

  py::class_<Sample>(module, "Sample").def(py::init(&makeSample));
  module.def("log_evidence", &logEvidence, Unlocked());
  module.def("most_evident", &mostEvident, Unlocked());
}

}  // namespace gmrf
