#include "rbpf_node/diagnostics.hpp"

#include <filesystem>
#include <fstream>
#include <string>
#include <utility>

namespace rbpf_node {

namespace {

// Silence of a stream: a warning, and an error.
constexpr double kOdometrySilence_s[] = {5.0, 10.0};
constexpr double kPingSilence_s[] = {10.0, 60.0};

double now_s() { return ros::WallTime::now().toSec(); }

void put(const Verdict& verdict, diagnostic_updater::DiagnosticStatusWrapper& report) {
  report.summary(static_cast<unsigned char>(verdict.level), verdict.text);
}

// Messages of a kind, "odometry" or "pings", that were refused.
std::map<std::string, std::uint64_t> refusedOf(const std::string& kind,
                                               const rbpf_svgp_slam::FilterStatus& status) {
  std::map<std::string, std::uint64_t> refused;
  for (std::size_t i = 0; i < status.refusal_reasons.size(); ++i) {
    const std::string& reason = status.refusal_reasons[i];
    if (reason.rfind(kind + "/", 0) == 0) refused[reason] = status.refusal_counts[i];
  }
  return refused;
}

std::optional<double> freeMbOf(const std::string& folder) {
  std::error_code error;
  const std::filesystem::space_info space = std::filesystem::space(folder, error);
  if (error) return std::nullopt;
  return static_cast<double>(space.available) / 1e6;
}

// A line of /proc/meminfo, MB.
std::optional<double> memoryMb(const std::string& wanted) {
  std::ifstream file("/proc/meminfo");
  std::string name;
  std::string unit;
  double kib = 0.0;
  while (file >> name >> kib && std::getline(file, unit)) {
    if (name == wanted + ":") return kib * 1024.0 / 1e6;
  }
  return std::nullopt;
}

}  // namespace

Diagnostics::Diagnostics(const ros::NodeHandle& node, const ros::NodeHandle& private_node,
                         Sources sources)
    : sources_(std::move(sources)),
      start_(ros::WallTime::now()),
      odometry_("odometry", "", kOdometrySilence_s[0], kOdometrySilence_s[1]),
      pings_("pings", "odometry, or for the mount of their sensor", kPingSilence_s[0],
             kPingSilence_s[1]),
      updater_(node, private_node, ros::this_node::getName()) {
  updater_.setHardwareID("none");
  updater_.add("input", [this](Report& report) { reportInput(report); });
  updater_.add("survey", [this](Report& report) { reportSurvey(report); });
  updater_.add("filter", [this](Report& report) { reportFilter(report); });
  updater_.add("maps", [this](Report& report) { reportMaps(report); });
  updater_.add("machine", [this](Report& report) { reportMachine(report); });
  updater_.add("journal", [this](Report& report) { reportJournal(report); });
}

void Diagnostics::reportInput(Report& report) {
  const rbpf_svgp_slam::FilterStatus now = sources_.status();
  const IntakeState intake = sources_.intake.state();
  const bool is_awaited = sources_.input == Input::kLive && !is_over_;
  Verdict verdict = odometry_.judge(
      {now.odometry_messages, refusedOf("odometry", now), 0, intake.odometry_receipt_age_s},
      is_awaited, now_s());
  if (now.mapping_paused) {
    verdict.add(Level::kWarn, "mapping is paused: pings are not taken in");
  } else {
    verdict.add(pings_.judge(
        {now.pings, refusedOf("pings", now), now.pings_waiting, intake.ping_receipt_age_s},
        is_awaited, now_s()));
  }
  if (is_over_) verdict.add(Level::kOk, "the survey is over");
  put(verdict, report);
  report.add("odometry messages", now.odometry_messages);
  report.add("odometry, from stamp to receipt (s)", intake.odometry_receipt_age_s);
  report.add("pings", now.pings);
  report.add("pings, from stamp to receipt (s)", intake.ping_receipt_age_s);
  report.add("pings waiting", now.pings_waiting);
  report.add("pings dropped", now.pings_dropped);
  report.add("pings rejected", now.pings_rejected);
  report.add("fixes", now.fixes);
  report.add("fixes refused", now.fixes_refused);
  for (std::size_t i = 0; i < now.refusal_reasons.size(); ++i) {
    report.add(now.refusal_reasons[i],
               std::to_string(now.refusal_counts[i]) + "; first: " + now.refusal_examples[i]);
  }
  report.add("ping age, 99th percentile (s)", now.ping_age_p99_s);
  report.add("beams", now.beams);
  report.add("beams rejected", now.beams_rejected);
}

void Diagnostics::reportSurvey(Report& report) const {
  Verdict verdict{Level::kOk, "nothing is wrong with the survey as a whole"};
  for (const rbpf_core::Finding& finding : sources_.intake.state().findings) {
    const bool is_error = finding.severity == rbpf_core::Severity::kError;
    verdict.add(is_error ? Level::kError : Level::kWarn, finding.name);
    report.add(finding.name, finding.text);
  }
  put(verdict, report);
}

void Diagnostics::reportFilter(Report& report) {
  const rbpf_svgp_slam::FilterStatus now = sources_.status();
  put(prompts_.judge({now.prompts, now.prompts_vetoed, now.prompts_failed, now.epoch,
                      now.resamplings_failed, now.message}),
      report);
  report.add("effective particles", now.n_eff);
  report.add("prompts", now.prompts);
  report.add("prompts vetoed", now.prompts_vetoed);
  report.add("prompts skipped", now.prompts_skipped);
  report.add("prompts failed", now.prompts_failed);
  report.add("resamplings", now.epoch);
  report.add("resamplings failed", now.resamplings_failed);
}

void Diagnostics::reportMaps(Report& report) {
  const std::uint32_t epoch = sources_.loop_closing.epoch();
  const rbpf_core::MapsState maps = sources_.maps.state(epoch);
  const double now = now_s();
  resamplings_.look(epoch, now);
  MapsFacts facts;
  facts.nodes = maps.nodes;
  facts.silent_s = sources_.maps.silence();
  facts.nodes_following = maps.nodes_heard;
  facts.particles = sources_.params.filter.particles;
  facts.maps_ready = maps.maps_ready;
  facts.running_s = now - start_.toSec();
  facts.resampled_s = resamplings_.quietFor(now).value_or(facts.running_s);
  facts.is_live = sources_.input == Input::kLive;
  put(judgeMaps(facts), report);
  report.add("maps ready", maps.maps_ready);
  report.add("training steps", maps.steps);
}

void Diagnostics::reportJournal(Report& report) const {
  if (!sources_.journal) return put({Level::kOk, "none is kept"}, report);
  const SurveyJournal& journal = *sources_.journal;
  put(judgeJournal({journal.problem(), journal.waitingBytes()}), report);
  report.add("file", journal.path());
  report.add("MB", static_cast<double>(journal.bytes()) / 1e6);
}

void Diagnostics::reportMachine(Report& report) const {
  MachineFacts facts;
  if (sources_.journal) {
    facts.folder = std::filesystem::path(sources_.journal->path()).parent_path();
    facts.disk_free_mb = freeMbOf(facts.folder);
  }
  facts.memory_available_mb = memoryMb("MemAvailable");
  facts.memory_mb = memoryMb("MemTotal");
  put(judgeMachine(facts), report);
  if (facts.disk_free_mb) report.add("free on disk (MB)", *facts.disk_free_mb);
  if (facts.memory_available_mb) report.add("memory available (MB)", *facts.memory_available_mb);
}

}  // namespace rbpf_node
