// Writes down what changes a survey, while it goes on.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "rbpf_core/change.hpp"

namespace rbpf_core {

// A thread of its own hands each record to the operating system as soon as it is there, which a
// death of the program does not undo, and asks for it to be on the disk once a second, which is
// what a loss of power may cost. Nobody who writes waits for a disk: if it falls far behind or
// fails, the journal ends there for good, and says so; what has been written stays.
//
// May be called from any thread.
class JournalWriter : public ChangeObserver {
 public:
  // Of a file that is there already.
  enum class Existing { kRefuse, kOverwrite };

  // Told once, by the writing thread, why the journal has ended before its time.
  using OnFailure = std::function<void(const std::string& why)>;

  // A new file. Throws std::runtime_error that names it if it cannot be written, if there is one
  // and that is refused, or if another process writes it.
  JournalWriter(const std::string& path, Existing existing, OnFailure on_failure);
  // Goes on after the first so many bytes of a file, and cuts off the rest. Throws as above.
  JournalWriter(const std::string& path, std::uint64_t whole_bytes, OnFailure on_failure);
  // Writes down what has come.
  ~JournalWriter() override;

  void onChange(const Change& change) override;
  // Waits until the operating system has what has come so far, for a second at most.
  void settle() override;

  // Why the journal has ended; empty: it goes on.
  std::string problem() const;
  // In the file, as far as it is known to be whole.
  std::uint64_t bytes() const;
  // That have come and are not yet there.
  std::uint64_t waitingBytes() const;

 private:
  void open(const std::string& path, int flags);
  void start();
  void work();
  // To the end of the file; says what went wrong, or nothing.
  std::string write(const std::vector<std::uint8_t>& bytes);
  std::string sync();
  // Expects mutex_ to be held.
  void fail(const std::string& why);

  const std::string path_;
  const OnFailure on_failure_;
  int file_ = -1;

  mutable std::mutex mutex_;  // guards what follows
  std::condition_variable come_;
  std::condition_variable handed_over_;
  std::vector<std::uint8_t> waiting_;
  std::uint64_t bytes_come_ = 0;
  std::uint64_t bytes_handed_over_ = 0;
  bool ends_ = false;
  std::string problem_;

  std::thread thread_;
};

}  // namespace rbpf_core
