#include "rbpf_core/journal/journal_writer.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <filesystem>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "rbpf_core/journal/journal_format.hpp"

namespace rbpf_core {

namespace {

using Clock = std::chrono::steady_clock;

constexpr auto kSyncPeriod = std::chrono::seconds(1);
constexpr auto kSettleAtMost = std::chrono::seconds(1);
// That may wait for the disk: some minutes of a large sonar.
constexpr std::size_t kMostWaiting_bytes = std::size_t{64} << 20;

std::string lastError() { return std::generic_category().message(errno); }

// A new file is not safe before its folder's entry is.
void syncFolderOf(const std::string& path) {
  const std::string folder = std::filesystem::absolute(path).parent_path();
  const int opened = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (opened < 0) return;
  fsync(opened);
  ::close(opened);
}

}  // namespace

JournalWriter::JournalWriter(const std::string& path, Existing existing, OnFailure on_failure)
    : path_(path), on_failure_(std::move(on_failure)) {
  std::error_code ignored;  // what is wrong with the folder is told when the file is opened
  std::filesystem::create_directories(std::filesystem::absolute(path).parent_path(), ignored);
  open(path, O_CREAT);
  struct stat is {};
  if (fstat(file_, &is) == 0 && is.st_size > 0 && existing == Existing::kRefuse) {
    ::close(file_);
    throw std::runtime_error("journal " + path + " is there already, of " +
                             std::to_string(is.st_size) +
                             " bytes; expected none, or to be told to resume or to overwrite it");
  }
  // a device has no length
  std::string problem = S_ISREG(is.st_mode) && ftruncate(file_, 0) != 0 ? lastError() : "";
  if (problem.empty()) problem = write(journal_format::fileHead());
  if (problem.empty()) problem = sync();
  if (!problem.empty()) {
    ::close(file_);
    throw std::runtime_error("journal " + path + " cannot be written: " + problem);
  }
  syncFolderOf(path);
  start();
}

JournalWriter::JournalWriter(const std::string& path, std::uint64_t whole_bytes,
                             OnFailure on_failure)
    : path_(path), on_failure_(std::move(on_failure)) {
  open(path, 0);
  if (ftruncate(file_, static_cast<off_t>(whole_bytes)) != 0 || lseek(file_, 0, SEEK_END) < 0) {
    const std::string problem = lastError();
    ::close(file_);
    throw std::runtime_error("journal " + path + " cannot be cut to its " +
                             std::to_string(whole_bytes) + " whole bytes: " + problem);
  }
  bytes_come_ = bytes_handed_over_ = whole_bytes;
  start();
}

JournalWriter::~JournalWriter() {
  {
    const std::lock_guard lock(mutex_);
    ends_ = true;
  }
  come_.notify_one();
  thread_.join();
  ::close(file_);
}

void JournalWriter::open(const std::string& path, int flags) {
  file_ = ::open(path.c_str(), O_RDWR | O_CLOEXEC | flags, 0644);
  if (file_ < 0) throw std::runtime_error("journal " + path + " cannot be opened: " + lastError());
  // gone with the process, however it ends
  if (flock(file_, LOCK_EX | LOCK_NB) == 0) return;
  ::close(file_);
  throw std::runtime_error("journal " + path + " is being written by another process");
}

void JournalWriter::start() {
  bytes_come_ = bytes_handed_over_ =
      std::max<std::uint64_t>(bytes_come_, journal_format::kFileHeadBytes);
  thread_ = std::thread([this] { work(); });
}

// ---- what comes ----------------------------------------------------------------------------

void JournalWriter::onChange(const Change& change) {
  const std::vector<std::uint8_t> record = journal_format::toRecord(change);
  {
    const std::lock_guard lock(mutex_);
    if (!problem_.empty()) return;
    if (waiting_.size() + record.size() > kMostWaiting_bytes) {
      return fail(std::to_string(waiting_.size()) + " bytes wait for a disk that is too slow");
    }
    waiting_.insert(waiting_.end(), record.begin(), record.end());
    bytes_come_ += record.size();
  }
  come_.notify_one();
}

void JournalWriter::settle() {
  std::unique_lock lock(mutex_);
  const std::uint64_t goal = bytes_come_;
  handed_over_.wait_for(lock, kSettleAtMost,
                        [&] { return bytes_handed_over_ >= goal || !problem_.empty(); });
}

std::string JournalWriter::problem() const {
  const std::lock_guard lock(mutex_);
  return problem_;
}

std::uint64_t JournalWriter::bytes() const {
  const std::lock_guard lock(mutex_);
  return bytes_handed_over_;
}

std::uint64_t JournalWriter::waitingBytes() const {
  const std::lock_guard lock(mutex_);
  return problem_.empty() ? bytes_come_ - bytes_handed_over_ : 0;
}

// ---- the thread ----------------------------------------------------------------------------

void JournalWriter::work() {
  Clock::time_point next_sync = Clock::now() + kSyncPeriod;
  bool is_synced = true;
  std::unique_lock lock(mutex_);
  while (problem_.empty() && !(ends_ && waiting_.empty())) {
    const auto has_work = [&] { return ends_ || !waiting_.empty() || !problem_.empty(); };
    if (is_synced) {
      come_.wait(lock, has_work);
    } else {
      come_.wait_until(lock, next_sync, has_work);
    }
    const std::vector<std::uint8_t> records = std::exchange(waiting_, {});
    lock.unlock();
    std::string problem = write(records);
    is_synced = is_synced && records.empty();
    if (problem.empty() && !is_synced && Clock::now() >= next_sync) {
      problem = sync();
      is_synced = true;
      next_sync = Clock::now() + kSyncPeriod;
    }
    lock.lock();
    if (problem.empty()) {
      bytes_handed_over_ += records.size();
    } else {
      fail(problem);
    }
    handed_over_.notify_all();
  }
  const std::string problem = problem_;
  lock.unlock();
  if (problem.empty()) {
    sync();  // there is nobody left to be told
  } else if (on_failure_) {
    on_failure_("journal " + path_ + " has ended: " + problem);
  }
}

std::string JournalWriter::write(const std::vector<std::uint8_t>& bytes) {
  for (std::size_t done = 0; done < bytes.size();) {
    const ssize_t count = ::write(file_, bytes.data() + done, bytes.size() - done);
    if (count < 0 && errno != EINTR) return lastError();
    if (count > 0) done += static_cast<std::size_t>(count);
  }
  return "";
}

std::string JournalWriter::sync() {
  // EINVAL: what cannot be synchronised, as a device
  return fdatasync(file_) == 0 || errno == EINVAL ? "" : lastError();
}

void JournalWriter::fail(const std::string& why) {
  if (!problem_.empty()) return;
  problem_ = why;
  waiting_ = {};
  come_.notify_one();
}

}  // namespace rbpf_core
