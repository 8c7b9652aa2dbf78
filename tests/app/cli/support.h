// Runs the program and looks at what it did.
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>

#include "tests/places.h"

namespace interneuron::cli {

struct Ran {
  int code = -1;
  std::string output;
};

// Through the shell; `arguments` follow the name of the program. What it says on stderr is part of
// the output, or else of that of the test, which CTest shows where one fails.
inline Ran run_program(const std::string& program, const std::string& arguments,
                       bool with_stderr = true) {
  // Testbeds keep their state in the build folder, not in the user's.
  const std::filesystem::path state = places::build() + "/run";
  std::filesystem::create_directories(state);
  // Nor is the key of whoever runs the tests used.
  const std::string command = "XDG_RUNTIME_DIR='" + state.string() + "' XDG_CONFIG_HOME='" +
                              places::build() + "/no-config' '" + program + "' " + arguments +
                              (with_stderr ? " 2>&1 </dev/null" : " </dev/null");
  Ran ran;
  FILE* pipe = ::popen(command.c_str(), "r");
  if (pipe == nullptr) return ran;
  std::array<char, 4096> chunk;
  while (const std::size_t n = std::fread(chunk.data(), 1, chunk.size(), pipe)) {
    ran.output.append(chunk.data(), n);
  }
  const int status = ::pclose(pipe);
  ran.code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  return ran;
}

inline Ran run(const std::string& arguments, bool with_stderr = true) {
  return run_program(places::program(), arguments, with_stderr);
}

// A program that ended with this exit code, and said this among the rest.
MATCHER_P2(EndsSaying, code, text, "") {
  *result_listener << "exit code " << arg.code << ": " << arg.output;
  return arg.code == code && arg.output.find(text) != std::string::npos;
}

// A folder that is gone after the test.
class TempFolder {
 public:
  TempFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "interneuron-XXXXXX").string();
    if (::mkdtemp(name.data()) != nullptr) path_ = name;
  }
  ~TempFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TempFolder(const TempFolder&) = delete;
  TempFolder& operator=(const TempFolder&) = delete;
  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }
  std::string string() const { return path_.string(); }

 private:
  std::filesystem::path path_;
};

// Whether this system lets us make namespaces; otherwise why not.
inline std::string no_testbed() {
  const Ran up = run("testbed up --name probe-" + std::to_string(::getpid()) + " --link clean");
  if (up.code == 0) {
    run("testbed down --name probe-" + std::to_string(::getpid()));
    return "";
  }
  return up.output;
}

}  // namespace interneuron::cli
