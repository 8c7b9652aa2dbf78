// The tools' processes: found, started inside a testbed, ended; and what they leave on disk.
// Errors: Failure. Thread-safety: none; one thread.
#pragma once

#include <filesystem>
#include <initializer_list>
#include <string>
#include <vector>

#include "host/process/child.h"
#include "netns/state/hosts.h"
#include "netns/state/state.h"

namespace interneuron::cli::verify {

struct Tool {
  const char* program;
  const char* package;  // Debian's
};
// Throws Failure (77) that names the packages of those missing.
void require_tools(std::initializer_list<Tool> tools);

// Lets tcpdump start where the testbed has a user namespace of its own: there a process may not
// call setgroups(), which tcpdump does although it is to stay what it is (-Z root). From now on the
// call succeeds without effect, in this process and those that it starts.
void allow_setgroups();

// A folder that only we can read, gone with this object.
class PrivateFolder {
 public:
  PrivateFolder();
  ~PrivateFolder();
  PrivateFolder(const PrivateFolder&) = delete;
  PrivateFolder& operator=(const PrivateFolder&) = delete;
  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }

 private:
  std::filesystem::path path_;
};

// One program inside the testbed, with stdout and stderr in files NAME.out and NAME.err of a
// folder. Its destructor ends it.
class Process {
 public:
  Process(const netns::State& state, netns::Host host, const std::vector<std::string>& argv,
          const PrivateFolder& folder, const std::string& name);

  // Sends the signal and waits for the end; one that has not ended after 2 s is killed.
  void end(int signal);
  std::string output() const;  // so far; binary
  std::string errors() const;
  // The last line that it wrote to either, without its newline: usually what went wrong.
  std::string last_words() const;

 private:
  std::filesystem::path stem_;
  Child child_;
};

// Until a process has written `text` to either file, at most `bound`. False when it did not.
bool await_text(const Process& process, const std::string& text, Duration bound);

}  // namespace interneuron::cli::verify
