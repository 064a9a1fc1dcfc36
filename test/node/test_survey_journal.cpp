// The live node's private parameters of its journal.
#include <gtest/gtest.h>

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

}  // namespace
}  // namespace rbpf_node
