#include "app/process/progress.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

#include "app/process/signals.h"

namespace interneuron::process {
namespace {

// How often a terminal's line is written again: often enough to look alive.
constexpr auto kTick = std::chrono::milliseconds(50);

}  // namespace

void Progress::tell(const std::string& what, std::size_t done, std::size_t count) {
  if (quiet_) return;
  if (done == count) {
    line_.clear();
  } else {
    line_.show(fmt::format("{}: {} of {} runs", what, done, count));
  }
  if (!line_.live() && done == 0) fmt::print(stderr, "{}: {} runs\n", what, count);
}

void Progress::for_each(const std::string& what, std::size_t count,
                        const std::function<void(std::size_t)>& work) {
  std::atomic<std::size_t> next{0};
  std::atomic<std::size_t> done{0};
  std::atomic<std::size_t> busy{0};
  std::mutex mutex;
  std::exception_ptr error;
  const auto worker = [&] {
    for (std::size_t i = next++; i < count && SignalWatch::last() == 0; i = next++) {
      try {
        work(i);
      } catch (...) {
        const std::scoped_lock lock(mutex);
        if (!error) error = std::current_exception();
        next = count;
      }
      ++done;
    }
    --busy;
  };
  tell(what, 0, count);
  {
    std::vector<std::jthread> threads;
    busy = std::clamp<std::size_t>(std::thread::hardware_concurrency(), 1, std::max(count, 1UL));
    for (std::size_t i = busy; i > 0; --i) threads.emplace_back(worker);
    for (std::size_t told = 0; busy > 0;) {
      std::this_thread::sleep_for(kTick);
      if (done != told) tell(what, told = done, count);
    }
  }
  if (error) std::rethrow_exception(error);
  SignalWatch::check();
  tell(what, count, count);
}

}  // namespace interneuron::process
