// What threads leave for one thread, in the order in which it came. Header only.
#pragma once

#include <condition_variable>
#include <mutex>
#include <utility>
#include <vector>

namespace interneuron {

// put() is for any thread, take() for the one that reads, which is to be woken where put() says so.
// Whoever must not leave more than is read waits for room first. Thread-safe.
template <class Value>
class Mailbox {
 public:
  explicit Mailbox(std::size_t most) : most_(most) {}

  // Whether the reader sleeps as far as is known here: wake it. It is woken once for all that comes
  // before it reads.
  bool put(Value&& value) {
    const std::lock_guard lock(mutex_);
    waiting_.push_back(std::move(value));
    return waiting_.size() == 1;
  }
  // The same where there is room; else the value is dropped. `wake`: as put() says.
  bool put_if_room(Value&& value, bool& wake) {
    const std::lock_guard lock(mutex_);
    if (waiting_.size() >= most_) return false;
    waiting_.push_back(std::move(value));
    wake = waiting_.size() == 1;
    return true;
  }
  std::vector<Value> take() {
    std::vector<Value> out;
    {
      const std::lock_guard lock(mutex_);
      out.swap(waiting_);
    }
    if (!out.empty()) has_room_.notify_all();
    return out;
  }
  // Until less than `most` waits, or close().
  void wait_for_room() {
    std::unique_lock lock(mutex_);
    has_room_.wait(lock, [this] { return waiting_.size() < most_ || is_closed_; });
  }
  // Nobody waits any more.
  void close() {
    {
      const std::lock_guard lock(mutex_);
      is_closed_ = true;
    }
    has_room_.notify_all();
  }

 private:
  const std::size_t most_;
  std::mutex mutex_;
  std::condition_variable has_room_;
  std::vector<Value> waiting_;
  bool is_closed_ = false;
};

}  // namespace interneuron
