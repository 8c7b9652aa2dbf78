// How a running `interneuron vehicle` or `road` tells `interneuron links` and `top` on the same
// host of its links: lines of JSON over an abstract Unix socket, which leaves no file behind.
// Abstract sockets belong to a network namespace, as NICs do.
//
// Any process in the namespace can connect, or offer a socket of such a name. Both sides ask the
// kernel for the other's user (SO_PEERCRED): a server answers only its own user and root, and a
// reader believes only these, but root reads the programs of all users; printable() of row.h keeps
// their text from doing harm on its terminal. Readers, programs and the length of a line are
// bounded (live_state.cc), and a slow reader never delays the program.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "interneuron/time.h"
#include "node/io/file_descriptor.h"

namespace interneuron::watch {

// Serves the newest line to every reader that connects. Owns a thread; publish() and wanted() may
// be called from any other. A reader that is slow misses lines; one that has missed 20 in a row is
// dropped.
class LiveServer {
 public:
  // Without an argument the name is that of this process. Never throws, because the program works
  // without a server as well; problem() then says what is wrong.
  explicit LiveServer(const std::string& name = own_name());
  ~LiveServer();
  LiveServer(const LiveServer&) = delete;
  LiveServer& operator=(const LiveServer&) = delete;

  // Whether a reader is connected; without one, published lines are lost.
  bool wanted() const { return reader_count_.load(std::memory_order_relaxed) > 0; }
  // `line` has no newline.
  void publish(std::string line);
  const std::string& problem() const { return problem_; }
  // How often a reader could not be taken because this process or system has too many files open.
  // After each such time no reader is taken for kPause; they wait, and lines go on to the others.
  std::uint64_t refusals() const { return refusals_.load(std::memory_order_relaxed); }
  // As often as a line is published. No measurement behind this value: it only has to be long
  // beside a system call, and short for a person who waits.
  static constexpr Duration kPause = std::chrono::milliseconds(500);

  static std::string own_name();

 private:
  struct Reader {
    io::FileDescriptor socket;
    // What has not been sent yet of the present line, and how many lines have been missed since.
    std::string unsent;
    int missed = 0;
  };
  void serve();
  void take_reader();
  int poll_timeout_ms() const;
  void tell_newest();
  static bool send_rest(Reader& reader);

  std::string problem_;
  io::FileDescriptor listener_;
  io::FileDescriptor wake_;
  // Used by the thread alone.
  std::vector<Reader> readers_;
  // Until when no reader is taken.
  TimePoint paused_until_{};
  std::atomic<int> reader_count_{0};
  std::atomic<std::uint64_t> refusals_{0};
  std::atomic<bool> stop_{false};
  struct Mailbox;
  std::unique_ptr<Mailbox> mailbox_;
  std::thread thread_;
};

// The readers' side: connects to every program of this network namespace. Thread-compatible.
class LiveReader {
 public:
  LiveReader();
  ~LiveReader();
  // The names of the sockets that exist now in this network namespace.
  static std::vector<std::string> names();
  // Connects to new programs, forgets those that have gone, and returns the newest whole line of
  // each. Never blocks.
  std::vector<std::string> lines();
  // How many connected programs have not sent a line yet.
  std::size_t silent() const;

 private:
  struct Connection {
    std::string name;
    io::FileDescriptor socket;
    std::string pending;
    std::string newest;
  };
  void connect(const std::string& name);
  static bool read(Connection& connection);

  std::vector<Connection> connections_;
};

}  // namespace interneuron::watch
