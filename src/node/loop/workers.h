// The threads of a Node beside its loop: those that compute, and the one that waits for signals.
#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/signal_set.hpp>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace interneuron {

// A queue of jobs and the threads that run them, in the order in which the jobs came. The queue is
// not bounded.
//
// submit() and stop() belong to one thread, the loop thread of a Node. Jobs run on the workers'
// threads and must not throw: an exception would end the process. Owns its threads. The constructor
// throws std::system_error when a thread cannot be started.
class Workers {
 public:
  explicit Workers(std::size_t threads);
  ~Workers() { stop(); }
  Workers(const Workers&) = delete;
  Workers& operator=(const Workers&) = delete;

  // Ignored after stop().
  void submit(std::function<void()> job);
  // Drops the jobs that wait, waits for those that run.
  void stop();

 private:
  void work();

  std::mutex mutex_;
  std::condition_variable wake_;
  // mutex_ guards both.
  std::deque<std::function<void()>> jobs_;
  bool stopping_ = false;
  std::vector<std::thread> threads_;
};

// Tells of the first SIGINT or SIGTERM that comes while it lives, on a thread of its own.
class SignalThread {
 public:
  explicit SignalThread(std::function<void(int)> on_signal);
  ~SignalThread();
  SignalThread(const SignalThread&) = delete;
  SignalThread& operator=(const SignalThread&) = delete;

 private:
  boost::asio::io_context context_{1};
  boost::asio::signal_set signals_;
  std::thread thread_;
};

}  // namespace interneuron
