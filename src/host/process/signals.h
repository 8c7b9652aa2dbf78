// SIGINT, SIGTERM and SIGHUP as a question, for commands with a loop of their own.
#pragma once

#include <array>
#include <csignal>

#include "interneuron/time.h"

namespace interneuron::cli {

// While it lives, the signals end nothing but the sleep they come in; last() tells the newest. One
// at a time.
class SignalWatch {
 public:
  SignalWatch();
  ~SignalWatch();
  SignalWatch(const SignalWatch&) = delete;
  SignalWatch& operator=(const SignalWatch&) = delete;

  static int last();  // 0: none yet
  // Throws Failure (128 + signal) when there was one.
  static void check();
  // Sleeps, but not through a signal: then as check().
  static void sleep(Duration length);

 private:
  static constexpr std::array kSignals{SIGINT, SIGTERM, SIGHUP};
  std::array<struct sigaction, kSignals.size()> old_;
};

}  // namespace interneuron::cli
