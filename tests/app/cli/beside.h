// A program that runs beside a test and says when it is ready.
#pragma once

#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <cstdio>
#include <string>

namespace interneuron::cli {

// A program that runs beside the test until it is gone; said() is its first line that begins with
// "ready".
class Beside {
 public:
  explicit Beside(const std::string& command) {
    int ends[2];
    if (::pipe2(ends, O_CLOEXEC) != 0) return;
    pid_ = ::fork();
    if (pid_ == 0) {
      ::dup2(ends[1], STDOUT_FILENO);
      ::execl("/bin/sh", "sh", "-c", ("exec " + command + " 2>/dev/null").c_str(), nullptr);
      ::_exit(127);
    }
    ::close(ends[1]);
    out_ = ::fdopen(ends[0], "r");
    std::array<char, 1024> line;
    while (said_.rfind("ready", 0) != 0 && std::fgets(line.data(), line.size(), out_) != nullptr) {
      said_ = line.data();
    }
  }
  ~Beside() {
    if (pid_ > 0) {
      ::kill(pid_, SIGTERM);
      ::waitpid(pid_, nullptr, 0);
    }
    if (out_ != nullptr) std::fclose(out_);
  }
  Beside(const Beside&) = delete;
  Beside& operator=(const Beside&) = delete;
  bool ready() const { return said_.rfind("ready", 0) == 0; }
  // The number at the end of what it said: its port.
  std::string port() const {
    const auto at = said_.find_last_of(": ");
    return said_.substr(at + 1, said_.size() - at - 2);
  }

 private:
  pid_t pid_ = -1;
  FILE* out_ = nullptr;
  std::string said_;
};

}  // namespace interneuron::cli
