// The path of the running program, for commands that an error message recommends.
#pragma once

#include <unistd.h>

#include <array>
#include <string>

namespace interneuron::io {

// "interneuron" where the system does not tell. Thread-safe.
inline std::string this_program() {
  std::array<char, 4096> path{};
  const ssize_t size = ::readlink("/proc/self/exe", path.data(), path.size());
  return size > 0 ? std::string(path.data(), static_cast<std::size_t>(size)) : "interneuron";
}

}  // namespace interneuron::io
