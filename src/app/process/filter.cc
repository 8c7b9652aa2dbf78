#include "app/process/filter.h"

#include <spawn.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>

#include "app/process/child.h"
#include "app/process/failure.h"
#include "app/process/whole_file.h"
#include "node/io/file_descriptor.h"

namespace interneuron::process {
namespace {

[[noreturn]] void fail(const std::string& program, int error) {
  throw Failure(kFailed, file_problem("cannot run", program, error));
}

io::FileDescriptor memory_file(const std::string& program) {
  io::FileDescriptor memory(::memfd_create("interneuron-filter", MFD_CLOEXEC));
  if (memory.get() < 0) fail(program, errno);
  return memory;
}

std::string content_of(int fd, const std::string& program) {
  std::string out(static_cast<std::size_t>(std::max<off_t>(::lseek(fd, 0, SEEK_END), 0)), '\0');
  std::size_t done = 0;
  while (done < out.size()) {
    const ssize_t n = ::pread(fd, out.data() + done, out.size() - done, static_cast<off_t>(done));
    if (n < 0) fail(program, errno);
    if (n == 0) break;
    done += static_cast<std::size_t>(n);
  }
  out.resize(done);
  return out;
}

}  // namespace

Filtered filter(const std::string& input, std::vector<std::string> command) {
  const std::string program = command.front();
  const io::FileDescriptor in = memory_file(program);
  const io::FileDescriptor out = memory_file(program);
  if (const int error = write_all(in.get(), input); error != 0) fail(program, error);
  ::lseek(in.get(), 0, SEEK_SET);
  std::vector<char*> argv;
  for (std::string& word : command) argv.push_back(word.data());
  argv.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  ::posix_spawn_file_actions_init(&actions);
  ::posix_spawn_file_actions_adddup2(&actions, in.get(), STDIN_FILENO);
  ::posix_spawn_file_actions_adddup2(&actions, out.get(), STDOUT_FILENO);
  pid_t pid = 0;
  Filtered result;
  result.start_error =
      ::posix_spawnp(&pid, program.c_str(), &actions, nullptr, argv.data(), environ);
  ::posix_spawn_file_actions_destroy(&actions);
  if (result.start_error != 0) return result;
  result.code = Child(pid).wait();
  result.output = content_of(out.get(), program);
  return result;
}

}  // namespace interneuron::process
