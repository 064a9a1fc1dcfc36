// A reader-writer lock in which readers cannot keep writers waiting.
#pragma once

#include <mutex>
#include <shared_mutex>

namespace rbpf_core {

// std::shared_mutex lets reader after reader in while a writer waits: map nodes that ask for
// minibatches without a pause would then stop the odometry. Here everybody passes one turnstile,
// and a writer holds it until it is in. Meets the standard's SharedMutex requirements, less the
// try_ ones.
class FairSharedMutex {
 public:
  void lock() {
    const std::lock_guard<std::mutex> turn(turnstile_);
    mutex_.lock();
  }
  void unlock() { mutex_.unlock(); }

  void lock_shared() {
    { const std::lock_guard<std::mutex> turn(turnstile_); }
    mutex_.lock_shared();
  }
  void unlock_shared() { mutex_.unlock_shared(); }

 private:
  std::mutex turnstile_;
  std::shared_mutex mutex_;
};

}  // namespace rbpf_core
