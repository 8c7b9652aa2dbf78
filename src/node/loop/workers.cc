#include "node/loop/workers.h"

#include <csignal>
#include <utility>

namespace interneuron {

Workers::Workers(std::size_t threads) {
  try {
    for (std::size_t i = 0; i < threads; ++i) threads_.emplace_back([this] { work(); });
  } catch (...) {
    stop();
    throw;
  }
}

void Workers::submit(std::function<void()> job) {
  {
    const std::lock_guard lock(mutex_);
    if (stopping_) return;
    jobs_.push_back(std::move(job));
  }
  wake_.notify_one();
}

void Workers::stop() {
  // Destroyed without the lock, because a job's destructor may do anything.
  std::deque<std::function<void()>> dropped;
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
    dropped.swap(jobs_);
  }
  wake_.notify_all();
  for (std::thread& thread : threads_) thread.join();
  threads_.clear();
}

void Workers::work() {
  for (;;) {
    std::function<void()> job;
    {
      std::unique_lock lock(mutex_);
      wake_.wait(lock, [this] { return stopping_ || !jobs_.empty(); });
      if (stopping_) return;
      job = std::move(jobs_.front());
      jobs_.pop_front();
    }
    job();
  }
}

SignalThread::SignalThread(std::function<void(int)> on_signal)
    : signals_(context_, SIGINT, SIGTERM) {
  signals_.async_wait(
      [on_signal = std::move(on_signal)](const boost::system::error_code& error, int signal) {
        if (!error) on_signal(signal);
      });
  thread_ = std::thread([this] { context_.run(); });
}

SignalThread::~SignalThread() {
  context_.stop();
  thread_.join();
}

}  // namespace interneuron
