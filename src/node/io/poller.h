// Which of many sockets are ready: one descriptor to wait for instead of one for each. Header and
// poller.cc; an epoll instance of the kernel (man 7 epoll).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "node/io/file_descriptor.h"

namespace interneuron::io {

// Names those of its handles that have something to read, that have something in their error queue,
// or that are writable where somebody waits for that. A handle stays ready until it was read
// or written, so that nobody need read until nothing is left. poll() is one system call, however
// many handles there are.
//
// The handles belong to the caller, who removes one before it closes it. Owns its own descriptor.
// Errors: the constructor and add() throw IoError. Thread-compatible.
class Poller {
 public:
  struct Ready {
    // As given to add().
    std::uint32_t name = 0;
    // There is something to read, or an error.
    bool readable = false;
    bool writable = false;
  };

  Poller();
  void add(int handle, std::uint32_t name);
  void remove(int handle);
  // Whether writable is to be told, too.
  void set_wants_write(int handle, std::uint32_t name, bool wants);

  // What is ready now, as much of it as there is room for; never waits. Valid until the next call.
  std::span<const Ready> poll();
  // Readable while anything is ready.
  int native_handle() const { return handle_.get(); }

 private:
  FileDescriptor handle_;
  std::vector<Ready> ready_;
};

}  // namespace interneuron::io
