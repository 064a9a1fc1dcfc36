// The Python module rbpf_svgp_slam._journal: the survey that a journal holds.
#include <pybind11/eigen.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <limits>

#include "rbpf_core/journal/journal_format.hpp"
#include "rbpf_core/journal/resume.hpp"

namespace py = pybind11;

namespace rbpf_core {

namespace {

using Rows6 = Eigen::Matrix<double, Eigen::Dynamic, 6, Eigen::RowMajor>;
using Rows3f = Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor>;
using Row6 = Eigen::Matrix<double, 1, 6>;

Row6 toRow(const Pose2& pose, const Attitude& attitude) {
  Row6 row;
  row << pose.x_m, pose.y_m, attitude.z_m, attitude.roll_rad, attitude.pitch_rad, pose.yaw_rad;
  return row;
}

Row6 toRow(const Eigen::Matrix3d& covariance) {
  Row6 row;
  row << covariance(0, 0), covariance(0, 1), covariance(0, 2), covariance(1, 1), covariance(1, 2),
      covariance(2, 2);
  return row;
}

void addPings(const FilterSnapshot& filter, py::dict* survey) {
  const auto P = static_cast<Eigen::Index>(filter.pings());
  Eigen::VectorXd stamp_s(P);
  Rows6 estimate(P, 6), covariance(P, 6), online(P, 6), online_covariance(P, 6), reckoned(P, 6);
  Eigen::Matrix<bool, Eigen::Dynamic, 1> held_out(P);
  Eigen::VectorXi beams_per_ping(P);
  Rows3f levelled(static_cast<Eigen::Index>(filter.beams() + filter.beamsHeldOut()), 3);
  Eigen::Index beams = 0;
  for (Eigen::Index i = 0; i < P; ++i) {
    const SurveyPing ping = filter.survey(static_cast<std::size_t>(i), 1).front();
    const PingRecord& record = ping.record;
    stamp_s[i] = record.stamp_s;
    estimate.row(i) = toRow(ping.estimate, record.attitude);
    covariance.row(i) = toRow(ping.covariance);
    online.row(i) = toRow(record.online, record.attitude);
    online_covariance.row(i) = toRow(record.online_covariance);
    reckoned.row(i) = toRow(record.dead_reckoning, record.attitude);
    held_out[i] = record.held_out;
    beams_per_ping[i] = static_cast<int>(record.beams);
    levelled.middleRows(beams, ping.levelled_m.cols()) = ping.levelled_m.transpose();
    beams += ping.levelled_m.cols();
  }
  (*survey)["stamp_s"] = stamp_s;
  (*survey)["estimate"] = estimate;
  (*survey)["estimate_covariance"] = covariance;
  (*survey)["online"] = online;
  (*survey)["online_covariance"] = online_covariance;
  (*survey)["dead_reckoning"] = reckoned;
  (*survey)["held_out"] = held_out;
  (*survey)["beams_per_ping"] = beams_per_ping;
  (*survey)["levelled"] = levelled;
}

void addParticles(const FilterSnapshot& filter, py::dict* survey) {
  const std::vector<Pose2> poses = filter.particles();
  Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor> rows(poses.size(), 3);
  for (std::size_t j = 0; j < poses.size(); ++j) {
    rows.row(static_cast<Eigen::Index>(j)) << poses[j].x_m, poses[j].y_m, poses[j].yaw_rad;
  }
  (*survey)["particles"] = rows;
  (*survey)["log_weights"] = Eigen::VectorXd(filter.logWeights());
}

// Columns as the fields of Fix.msg.
void addFixes(const FilterSnapshot& filter, py::dict* survey) {
  const double unknown = std::numeric_limits<double>::quiet_NaN();
  const auto F = static_cast<Eigen::Index>(filter.fixes());
  Eigen::VectorXd stamp(F), yaw(F), yaw_variance(F);
  Eigen::Matrix<double, Eigen::Dynamic, 2, Eigen::RowMajor> position(F, 2);
  Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor> covariance(F, 3), reckoned(F, 3);
  for (Eigen::Index i = 0; i < F; ++i) {
    const FixRecord& record = filter.fix(static_cast<std::size_t>(i));
    const Eigen::Matrix2d& known = record.fix.covariance_m2;
    const Pose2& pose = record.dead_reckoning;
    stamp[i] = record.fix.stamp_s;
    position.row(i) = record.fix.position_m;
    covariance.row(i) << known(0, 0), known(0, 1), known(1, 1);
    yaw[i] = record.fix.heading ? record.fix.heading->yaw_rad : unknown;
    yaw_variance[i] = record.fix.heading ? record.fix.heading->variance_rad2 : unknown;
    reckoned.row(i) << pose.x_m, pose.y_m, pose.yaw_rad;
  }
  py::dict fixes;
  fixes["stamp"] = stamp;
  fixes["position"] = position;
  fixes["covariance"] = covariance;
  fixes["yaw"] = yaw;
  fixes["yaw_variance"] = yaw_variance;
  fixes["dead_reckoning"] = reckoned;
  (*survey)["fixes"] = fixes;
}

py::dict read(const std::string& path) {
  ParticleFilter filter(paramsIn(path));
  const ResumedSurvey resumed = resumeFrom(path, &filter);
  const FilterSnapshot snapshot = filter.snapshot();
  py::dict survey;
  addPings(snapshot, &survey);
  addParticles(snapshot, &survey);
  survey["settings"] = resumed.settings.text;
  survey["resamplings"] = resumed.epoch;
  survey["prompts"] = resumed.loop_closing.prompts;
  addFixes(snapshot, &survey);
  survey["records"] = resumed.records;
  survey["programs"] = resumed.programs;
  survey["whole_bytes"] = resumed.whole_bytes;
  survey["lost_bytes"] = resumed.lost_tail ? resumed.lost_tail->bytes : 0;
  survey["why_lost"] = resumed.lost_tail ? resumed.lost_tail->why : "";
  return survey;
}

}  // namespace

PYBIND11_MODULE(_journal, m) {
  m.doc() = "Journals of surveys: the filter's state from all that has changed it.";
  m.attr("FORMAT_VERSION") = journal_format::kVersion;
  m.def("read", &read, py::arg("path"),
        "The survey of a journal, P pings with N beams: stamp_s [P], estimate, online and "
        "dead_reckoning [P, 6] x y z roll pitch yaw, estimate_covariance and online_covariance "
        "[P, 6] xx, xy, x yaw, yy, y yaw, yaw yaw, held_out and beams_per_ping [P], levelled "
        "[N, 3]; particles [J, 3] x y yaw, and their log_weights [J]; m, rad, frame map. fixes: "
        "columns as the fields of Fix.msg. settings: the program's parameters as XML-RPC. "
        "programs: that have written it, one after the other. lost_bytes: of "
        "a damaged tail, why_lost says why. Raises RuntimeError that names what is wrong.");
}

}  // namespace rbpf_core
