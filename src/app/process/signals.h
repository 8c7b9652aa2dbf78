// SIGINT, SIGTERM and SIGHUP for commands with a loop of their own, which ask whether one has come.
#pragma once

#include <array>
#include <csignal>

#include "interneuron/time.h"

namespace interneuron::process {

// While a SignalWatch lives, these signals do not end the process: they only interrupt sleep(), and
// last() tells the newest one. At most one may live at a time. sleep() belongs to one thread;
// last() and check() may be called from any.
class SignalWatch {
 public:
  SignalWatch();
  ~SignalWatch();
  SignalWatch(const SignalWatch&) = delete;
  SignalWatch& operator=(const SignalWatch&) = delete;

  // The number of the newest signal; 0: none has come.
  static int last();
  // Throws Failure (128 + signal) when there was one.
  static void check();
  // Sleeps, unless a signal comes: then it throws as check() does.
  static void sleep(Duration length);

 private:
  static constexpr std::array kSignals{SIGINT, SIGTERM, SIGHUP};
  std::array<struct sigaction, kSignals.size()> old_;
};

}  // namespace interneuron::process
