// Checks system calls that must succeed. Errors: TestbedError (1), "cannot ATTEMPT: " and the text
// of errno. Thread-safe.
#pragma once

#include <cerrno>
#include <cstring>
#include <string>

#include "netns/state/error.h"

namespace interneuron::netns {

[[noreturn]] inline void fail_errno(const std::string& attempt, int error = errno) {
  throw TestbedError(1, "cannot " + attempt + ": " + std::strerror(error));
}

// Returns `result`; throws when it is negative.
inline int check(int result, const std::string& attempt) {
  if (result < 0) fail_errno(attempt);
  return result;
}

}  // namespace interneuron::netns
