// The live node's journal: where it is, and a survey that goes on from it.
#pragma once

#include <ros/node_handle.h>

#include <memory>
#include <string>

#include "rbpf_core/journal/journal_writer.hpp"
#include "rbpf_core/journal/resume.hpp"
#include "rbpf_core/loop_closing.hpp"

namespace rbpf_node {

// Private parameters of the live node.
struct JournalParameters {
  // ~journal: the file; empty: none is kept.
  std::string path;
  // ~resume: the survey goes on where the file ends.
  bool resume = false;
  // ~overwrite: a journal or a run that is there already is lost. Otherwise it is refused.
  bool overwrite = false;
  // All parameters of the program.
  std::string program;
};

// Throws std::invalid_argument that names the parameter, its value and what was expected.
JournalParameters validJournalParameters(XmlRpc::XmlRpcValue tree);
// With all parameters as the server has them, for who reads the journal.
JournalParameters loadJournalParameters(const ros::NodeHandle& node,
                                        const ros::NodeHandle& private_node);

// Where a survey without a journal has left its run: throws std::runtime_error that names the file
// and what was expected.
void refuseEarlierRun(const std::string& journal);

// A survey is over, and its journal is kept under another name: PATH.1, PATH.2, ... Returns it.
std::string setAside(const std::string& path);

class SurveyJournal {
 public:
  // Brings filter and loop closing to where the journal ends if it is to be resumed, and writes
  // down from now on what changes them; neither has begun yet. Throws std::runtime_error as
  // JournalWriter, resumeFrom and refuseEarlierRun do.
  SurveyJournal(const JournalParameters& params, const rbpf_core::ProgramSettings& settings,
                rbpf_core::ParticleFilter* filter, rbpf_core::LoopClosing* loop_closing);
  ~SurveyJournal();

  const std::string& path() const { return path_; }
  std::uint64_t bytes() const { return writer_->bytes(); }
  // That the disk has still to take.
  std::uint64_t waitingBytes() const { return writer_->waitingBytes(); }
  // Why it has ended before its time; empty: it goes on.
  std::string problem() const { return writer_->problem(); }
  // How often the survey has gone on from it, this time included.
  std::uint32_t resumed() const { return resumed_; }

 private:
  void resume();

  const std::string path_;
  rbpf_core::ParticleFilter& filter_;
  rbpf_core::LoopClosing& loop_closing_;
  std::unique_ptr<rbpf_core::JournalWriter> writer_;
  std::uint32_t resumed_ = 0;
};

}  // namespace rbpf_node
