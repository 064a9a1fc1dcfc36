#include "rbpf_core/journal/resume.hpp"

#include <stdexcept>
#include <utility>

#include "rbpf_core/journal/filter_settings.hpp"

namespace rbpf_core {

namespace {

// Does to a filter what has been done to the one whose journal it is.
class Again {
 public:
  Again(ParticleFilter* filter, ResumedSurvey* survey) : filter_(*filter), survey_(*survey) {}

  void operator()(const FilterSettings&) const {}
  void operator()(ProgramSettings& settings) {
    if (survey_.programs++ > 0) filter_.goOn();
    survey_.settings = std::move(settings);
  }
  void operator()(const Odometry& odometry) {
    asBefore([&] { filter_.addOdometry(odometry); });
  }
  void operator()(Ping& ping) {
    asBefore([&] { filter_.addPing(std::move(ping)); });
  }
  void operator()(const Fix& fix) {
    asBefore([&] { filter_.addFix(fix); });
  }
  void operator()(const OdometryKept& kept) { filter_.keepOdometrySince(kept.since_s); }
  void operator()(const WeightsSet& weights) { filter_.setLogWeights(weights.log_weights); }
  void operator()(const Resampled& resampled) {
    filter_.resample(resampled.ancestors);
    ++survey_.epoch;
  }
  void operator()(const DrawnAnew& drawn) { filter_.drawAnew(drawn.given, drawn.at); }
  void operator()(const PastCorrection& correction) { filter_.correctPast(correction); }
  void operator()(const KnownError& error) { filter_.setKnownError(error); }
  void operator()(const FixesTaken&) { filter_.takeFixesToWeigh(); }
  void operator()(const SurveyFinished&) { filter_.finish(); }
  void operator()(const LoopClosingState& state) { survey_.loop_closing = state; }

 private:
  template <typename Add>
  static void asBefore(const Add& add) {
    try {
      add();
    } catch (const Refusal&) {
      // as it was then; the filter has counted it
    }
  }

  ParticleFilter& filter_;
  ResumedSurvey& survey_;
};

std::string noWholeRecord(const std::string& path) {
  return "journal " + path + " cannot be resumed: it holds no whole record";
}

}  // namespace

FilterParams paramsIn(const std::string& path) {
  const std::optional<Change> first = JournalReader(path).next();
  if (!first) throw std::runtime_error(noWholeRecord(path));
  const auto* settings = std::get_if<FilterSettings>(&*first);
  if (settings == nullptr) {
    throw std::runtime_error("journal " + path + " does not begin with the filter's parameters");
  }
  return paramsOf(*settings);
}

std::uint64_t surveyIn(const std::string& path) {
  JournalReader journal(path);
  journal.next();
  const std::optional<Change> second = journal.next();
  const auto* settings = second ? std::get_if<ProgramSettings>(&*second) : nullptr;
  if (settings == nullptr) {
    throw std::runtime_error("journal " + path +
                             " cannot be resumed: its second record is not the program's");
  }
  return settings->survey;
}

ResumedSurvey resumeFrom(const std::string& path, ParticleFilter* filter) {
  JournalReader journal(path);
  ResumedSurvey survey;
  Again again(filter, &survey);
  const FilterSettings now = settingsOf(filter->params());
  for (std::optional<Change> change = journal.next(); change; change = journal.next()) {
    const auto* settings = std::get_if<FilterSettings>(&*change);
    if ((survey.records == 0) != (settings != nullptr)) {
      throw std::runtime_error("journal " + path +
                               ": expected the filter's parameters as its first record, and once");
    }
    try {
      if (settings != nullptr) expectSameSettings(*settings, now);
      std::visit(again, *change);
    } catch (const std::exception& error) {
      throw std::runtime_error("journal " + path + " cannot be resumed at its record " +
                               std::to_string(survey.records) + ": " + error.what());
    }
    ++survey.records;
  }
  if (survey.records == 0) throw std::runtime_error(noWholeRecord(path));
  survey.whole_bytes = journal.wholeBytes();
  survey.lost_tail = journal.lostTail();
  return survey;
}

}  // namespace rbpf_core
