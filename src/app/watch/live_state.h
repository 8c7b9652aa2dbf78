// What a running `interneuron vehicle` or `road` tells `interneuron links` and `top` on the same
// host: lines of JSON over an abstract Unix socket, which leaves nothing behind. Abstract sockets
// belong to a network namespace, as NICs do. Only the same user and root are answered, and
// believed.
#pragma once

#include <atomic>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "host/io/file_descriptor.h"

namespace interneuron::cli {

// Serves the newest line to everyone who connects. One thread; publish() and wanted() are for any
// other one. A reader that is slow misses lines, one that is much too slow is dropped.
class LiveServer {
 public:
  // Without an argument the program's own name. Never throws: a program runs without it too;
  // problem() then says why it does.
  explicit LiveServer(const std::string& name = own_name());
  ~LiveServer();
  LiveServer(const LiveServer&) = delete;
  LiveServer& operator=(const LiveServer&) = delete;

  // Whether anyone is connected; what is published for nobody is lost.
  bool wanted() const { return reader_count_.load(std::memory_order_relaxed) > 0; }
  void publish(std::string line);  // without its newline
  const std::string& problem() const { return problem_; }

  static std::string own_name();

 private:
  struct Reader {
    io::FileDescriptor socket;
    std::string unsent;  // of the line it is being told
    int missed = 0;      // lines meanwhile
  };
  void serve();
  void take_reader();
  void tell_newest();
  static bool send_rest(Reader& reader);

  std::string problem_;
  io::FileDescriptor listener_;
  io::FileDescriptor wake_;
  std::vector<Reader> readers_;  // the thread's own
  std::atomic<int> reader_count_{0};
  std::atomic<bool> stop_{false};
  struct Mailbox;
  std::unique_ptr<Mailbox> mailbox_;
  std::thread thread_;
};

// The readers' side: connects to every program that is there. Thread-compatible.
class LiveReader {
 public:
  LiveReader();
  ~LiveReader();
  // The names of sockets that are there now, in this network namespace.
  static std::vector<std::string> names();
  // Connects to programs that have come, forgets those that have gone, reads what has arrived: the
  // newest whole line of each. Never blocks.
  std::vector<std::string> lines();
  // Of the programs that are connected, how many have not told a line yet.
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

}  // namespace interneuron::cli
