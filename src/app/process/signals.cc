#include "app/process/signals.h"

#include <algorithm>
#include <thread>

#include "app/process/failure.h"
#include "node/io/steady_clock.h"

namespace interneuron::process {

namespace {

// The longest uninterrupted sleep. A signal that comes just before a sleep does not end it, so long
// sleeps are made of short ones.
constexpr Duration kSignalNap = std::chrono::milliseconds(20);

volatile std::sig_atomic_t g_last = 0;

void remember(int signal) { g_last = signal; }

}  // namespace

SignalWatch::SignalWatch() {
  g_last = 0;
  struct sigaction action {};
  // Without SA_RESTART a signal ends the sleep that it comes in.
  action.sa_handler = remember;
  for (std::size_t i = 0; i < kSignals.size(); ++i) {
    ::sigaction(kSignals[i], nullptr, &old_[i]);
    // `nohup` starts programs with SIGHUP ignored, and it stays so.
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
    std::this_thread::sleep_for(std::min(end - now, kSignalNap));
  }
  check();
}

}  // namespace interneuron::process
