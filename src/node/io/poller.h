// Which of many handles are ready, and how a thread sleeps until one is. Header and poller.cc.
#pragma once

#include <poll.h>

#include <cstdint>
#include <span>
#include <vector>

#include "interneuron/time.h"
#include "node/io/file_descriptor.h"

namespace interneuron::io {

// Names those of its handles that have something to read, that have something in their error queue,
// or that are writable where somebody waits for that. A handle stays ready until it was read or
// written, so that nobody need read until nothing is left. wait() is one system call, ppoll(),
// which also ends at an instant, so that no timer is armed: hosts have a few network cards, and to
// look through them costs less than any further call.
//
// One thread waits. Others may add and remove handles meanwhile if a lock keeps these calls and
// prepare() apart; they count from the next prepare() on. The handles belong to the caller, who
// removes one before it closes it. Owns a descriptor of its own. Errors: the constructor throws
// IoError.
class Poller {
 public:
  struct Ready {
    // As given to add().
    std::uint32_t name = 0;
    // There is something to read, or an error.
    bool readable = false;
    bool writable = false;
  };
  enum class For : std::uint8_t { kAnything, kWake };

  Poller();
  void add(int handle, std::uint32_t name) { handles_.push_back({handle, name, false}); }
  void remove(int handle);
  // Whether writable is to be told, too.
  void set_wants_write(int handle, bool wants);

  // What wait() waits for from now on: the handles there are and wake(), or wake() alone.
  void prepare(For what);
  // Sleeps until something is ready, wake() was called, a signal comes or it is so late, and names
  // what is ready. Valid until the next call.
  std::span<const Ready> wait(TimePoint until);
  // Ends the wait() that is going on, or the next one. Any thread.
  void wake();

 private:
  struct Handle {
    int handle = -1;
    std::uint32_t name = 0;
    bool wants_write = false;
  };

  FileDescriptor wake_;
  std::vector<Handle> handles_;
  // What wait() waits for, wake_ first, and the names of the others.
  std::vector<pollfd> waiting_;
  std::vector<std::uint32_t> names_;
  std::vector<Ready> ready_;
};

}  // namespace interneuron::io
