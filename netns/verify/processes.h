// The processes of ping, iperf3 and tcpdump: whether they are installed, how they are started
// inside a testbed and ended, and where their output goes.
//
// Errors: Failure with an exit code and a remedy. Not thread-safe: one thread starts and ends all,
// as the kernel ends a child with the thread that started it.
#pragma once

#include <filesystem>
#include <initializer_list>
#include <string>
#include <vector>

#include "app/process/child.h"
#include "app/process/private_folder.h"
#include "netns/state/hosts.h"
#include "netns/state/state.h"

namespace interneuron::cli::verify {

struct Tool {
  const char* program;
  // The Debian package that has it.
  const char* package;
};
// Throws Failure (77), which names the missing programs and their packages, unless all are on PATH.
void require_tools(std::initializer_list<Tool> tools);

// Makes setgroups() succeed without effect, by a seccomp filter that this process and all that it
// starts keep for life. tcpdump needs it where the testbed has a user namespace of its own: the
// kernel forbids setgroups() there, and tcpdump calls it and gives up although it is told to stay
// root (-Z root). Without effect on machines that are neither x86-64 nor arm64.
void allow_setgroups();

// One program that runs inside one host of the testbed, with stdout and stderr in the files
// NAME.out and NAME.err of `folder`, which must outlive it. Owns the process: the destructor ends
// it. The constructor throws Failure or TestbedError when the program cannot be started.
class Process {
 public:
  Process(const netns::State& state, netns::Host host, const std::vector<std::string>& argv,
          const process::PrivateFolder& folder, const std::string& name);

  // Sends the signal and waits for the end; kills a process that has not ended after 2 s.
  void end(int signal);
  // All that it has written to stdout and to stderr so far; may hold any bytes.
  std::string output() const;
  std::string errors() const;
  // The last line that is not empty, of stderr or else of stdout: usually it says what went wrong.
  std::string last_words() const;

 private:
  std::filesystem::path stem_;
  process::Child child_;
};

// Waits until the process has written `text` to stdout or stderr, for `bound` at most. False when
// it has not.
bool await_text(const Process& process, const std::string& text, Duration bound);

}  // namespace interneuron::cli::verify
