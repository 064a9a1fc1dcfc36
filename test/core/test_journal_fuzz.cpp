// Whatever a journal's bytes are, it is read as far as it makes sense, or refused by an exception.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "journal_of_bytes.hpp"
#include "mutations.hpp"
#include "rbpf_core/journal/change_bytes.hpp"

namespace rbpf_core {
namespace {

class FuzzedJournal : public JournalTest {
 protected:
  FuzzedJournal() {
    write(path(), {whole.begin(), whole.end()});
    JournalReader reader(path());
    while (const auto change = reader.next()) changes.push_back(*change);
  }

  void resume(const std::vector<std::uint8_t>& bytes) {
    write(path("fuzzed"), {bytes.begin(), bytes.end()});
    ++(isResumed(path("fuzzed")) ? resumed : refused);
  }

  const std::vector<std::uint8_t> whole = wholeJournal(120);
  std::vector<Change> changes;
  std::size_t resumed = 0;
  std::size_t refused = 0;
};

TEST_F(FuzzedJournal, OfDamagedBytesIsResumedOrRefused) {
  for (std::uint32_t seed = 0; seed < 300; ++seed) resume(Mutations(seed).of(whole));
  EXPECT_GT(resumed, 100U);
  EXPECT_GT(refused, 2U);
}

// A stranger can make checksums, too.
TEST_F(FuzzedJournal, OfForgedRecordsIsResumedOrRefused) {
  for (std::uint32_t seed = 0; seed < 600; ++seed) {
    Mutations mutations(seed);
    std::vector<std::uint8_t> bytes = journal_format::fileHead();
    const std::size_t forged = 1 + mutations.below(changes.size() - 1);
    for (std::size_t k = 0; k < changes.size(); ++k) {
      Change change = changes[k];
      if (k == forged) {
        try {
          change = toChange(change.index(), mutations.of(toBytes(change)));
        } catch (const std::invalid_argument&) {
          // of another length: as a record whose checksum does not agree
        }
      }
      const std::vector<std::uint8_t> record = journal_format::toRecord(change);
      bytes.insert(bytes.end(), record.begin(), record.end());
    }
    resume(bytes);
  }
  EXPECT_GT(resumed, 300U);
  EXPECT_GT(refused, 0U);
}

TEST_F(FuzzedJournal, HasChangesOfWhichNoBytesMakeMoreThanTheyHold) {
  for (std::uint32_t seed = 0; seed < 8000; ++seed) {
    Mutations mutations(seed);
    const Change& change = changes[mutations.below(changes.size())];
    const std::size_t type = mutations.below(4) == 0 ? mutations.below(256) : change.index();
    const std::vector<std::uint8_t> bytes = mutations.of(toBytes(change));
    try {
      const Change read = toChange(type, bytes);
      ASSERT_EQ(toBytes(read).size(), bytes.size());
    } catch (const std::invalid_argument&) {
    }
  }
}

}  // namespace
}  // namespace rbpf_core
