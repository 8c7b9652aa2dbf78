#include "host/process/signals.h"

#include <algorithm>
#include <thread>

#include "host/io/steady_clock.h"
#include "host/process/failure.h"

namespace interneuron::cli {

namespace {

// A signal just before a sleep does not end it, so sleeps are short; chosen.
constexpr Duration kNap = std::chrono::milliseconds(20);

volatile std::sig_atomic_t g_last = 0;

void remember(int signal) { g_last = signal; }

}  // namespace

SignalWatch::SignalWatch() {
  g_last = 0;
  struct sigaction action {};
  action.sa_handler = remember;  // no SA_RESTART: a sleep ends
  for (std::size_t i = 0; i < kSignals.size(); ++i) {
    ::sigaction(kSignals[i], nullptr, &old_[i]);
    // `nohup` has it ignored, and means it.
    const bool keep = kSignals[i] == SIGHUP && old_[i].sa_handler == SIG_IGN;
    if (!keep) ::sigaction(kSignals[i], &action, nullptr);
  }
}

SignalWatch::~SignalWatch() {
  for (std::size_t i = 0; i < kSignals.size(); ++i) ::sigaction(kSignals[i], &old_[i], nullptr);
}

int SignalWatch::last() { return g_last; }

void SignalWatch::check() {
  if (g_last != 0) throw Failure(128 + g_last, "interrupted");
}

void SignalWatch::sleep(Duration length) {
  const TimePoint end = io::now() + length;
  for (TimePoint now = io::now(); now < end; now = io::now()) {
    check();
    std::this_thread::sleep_for(std::min(end - now, kNap));
  }
  check();
}

}  // namespace interneuron::cli
