// The live node's private parameters of its journal.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "error_of.hpp"
#include "rbpf_node/survey_journal.hpp"

namespace rbpf_node {
namespace {

XmlRpc::XmlRpcValue treeWith(const std::string& path, bool resume) {
  XmlRpc::XmlRpcValue tree;
  tree["~journal"] = path;
  tree["~resume"] = resume;
  tree["~overwrite"] = false;
  return tree;
}

TEST(JournalParameters, MayBeOfNoJournalAtAll) {
  EXPECT_EQ(validJournalParameters(treeWith("", false)).path, "");
  const JournalParameters params = validJournalParameters(treeWith("/run/survey.journal", true));
  EXPECT_EQ(params.path, "/run/survey.journal");
  EXPECT_TRUE(params.resume);
  EXPECT_FALSE(params.overwrite);
}

TEST(JournalParameters, NameAnAbsolutePath) {
  EXPECT_TRUE(contains(errorOf([] { validJournalParameters(treeWith("run/it", false)); }),
                       "parameter ~journal is run/it, expected an absolute path"));
}

TEST(JournalParameters, ResumeNothingWithoutAJournal) {
  EXPECT_TRUE(contains(errorOf([] { validJournalParameters(treeWith("", true)); }),
                       "parameter ~resume is true, expected false where there is no ~journal"));
}

TEST(EarlierRuns, AreRefusedByTheNameOfAFileOfTheirs) {
  std::string name = (std::filesystem::temp_directory_path() / "run.XXXXXX").string();
  const std::filesystem::path folder = mkdtemp(name.data());
  const std::string journal = folder / "survey.journal";
  std::ofstream(folder / "ground_truth.tum") << "what a survey may begin with";
  EXPECT_NO_THROW(refuseEarlierRun(journal));
  for (const std::string file : {"trajectory.tum", "survey.npz", "report.json"}) {
    std::ofstream(folder / file) << "an earlier run";
    try {
      refuseEarlierRun(journal);
      ADD_FAILURE() << file;
    } catch (const std::runtime_error& error) {
      EXPECT_TRUE(contains(error.what(), (folder / file).string() + " of an earlier run; expected "
                                                                    "none, or overwrite:=true"))
          << error.what();
    }
  }
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace rbpf_node
