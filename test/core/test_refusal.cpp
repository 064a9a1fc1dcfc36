#include <gtest/gtest.h>

#include <set>
#include <string>

#include "rbpf_core/refusal.hpp"

namespace rbpf_core {
namespace {

TEST(NameOf, IsAnotherForEveryKindAndReason) {
  std::set<std::string> names;
  for (const InputKind kind : {InputKind::kOdometry, InputKind::kPing, InputKind::kFix}) {
    for (int reason = 0; reason <= static_cast<int>(Reason::kSurveyOver); ++reason) {
      names.insert(nameOf(kind, static_cast<Reason>(reason)));
    }
  }
  EXPECT_EQ(names.size(), 3U * (static_cast<std::size_t>(Reason::kSurveyOver) + 1));
  EXPECT_EQ(names.count("pings/no_mount"), 1U);
  EXPECT_EQ(names.count("odometry/out_of_order"), 1U);
}

TEST(RefusalCounts, KeepWhatWasWrongWithTheFirstOfEach) {
  RefusalCounts counts;
  EXPECT_TRUE(counts.add(InputKind::kPing, Reason::kMalformed, "first"));
  EXPECT_FALSE(counts.add(InputKind::kPing, Reason::kMalformed, "second", 2));
  EXPECT_TRUE(counts.add(InputKind::kOdometry, Reason::kMalformed, "other"));
  const auto& count = counts.counts().at({InputKind::kPing, Reason::kMalformed});
  EXPECT_EQ(count.messages, 3U);
  EXPECT_EQ(count.example, "first");
  EXPECT_EQ(counts.total(), 4U);
}

TEST(RefusalCounts, KeepTextAlone) {
  RefusalCounts counts;
  counts.add(InputKind::kPing, Reason::kNoMount, "no way from 'mb\xff\n\x01s' to 'base_link'");
  EXPECT_EQ(counts.counts().begin()->second.example, "no way from 'mb???s' to 'base_link'");
}

TEST(RefusalCounts, TellWhatIsWrongFromWhatIsOnlyLost) {
  RefusalCounts counts;
  counts.add(InputKind::kPing, Reason::kNoBeams, "", 1);
  counts.add(InputKind::kPing, Reason::kWrongType, "", 2);
  counts.add(InputKind::kPing, Reason::kNoMount, "", 4);
  counts.add(InputKind::kPing, Reason::kSurveyOver, "", 8);
  counts.add(InputKind::kOdometry, Reason::kOutOfOrder, "", 16);
  EXPECT_EQ(counts.rejected(InputKind::kPing), 3U);
  EXPECT_EQ(counts.dropped(InputKind::kPing), 12U);
  EXPECT_EQ(counts.rejected(InputKind::kOdometry), 16U);
  EXPECT_EQ(counts.dropped(InputKind::kOdometry), 0U);
}

TEST(RefusalCounts, DoNotNoteThatNothingWasRefused) {
  RefusalCounts counts;
  EXPECT_FALSE(counts.add(InputKind::kPing, Reason::kNoMount, "nothing", 0));
  EXPECT_TRUE(counts.counts().empty());
}

TEST(RefusalCounts, AddUp) {
  RefusalCounts bag;
  bag.add(InputKind::kPing, Reason::kNoStamp, "in the bag", 2);
  RefusalCounts counts;
  counts.add(InputKind::kPing, Reason::kNoMount, "here");
  counts.add(bag);
  counts.add(bag);
  EXPECT_EQ(counts.total(), 5U);
  EXPECT_EQ(counts.counts().at({InputKind::kPing, Reason::kNoStamp}).example, "in the bag");
}

}  // namespace
}  // namespace rbpf_core
