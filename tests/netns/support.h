// What the tests of netns share.
#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <functional>
#include <optional>
#include <ostream>
#include <string>
#include <vector>

#include "netns/state/hosts.h"
#include "netns/state/options.h"
#include "netns/state/state.h"
#include "node/io/file_descriptor.h"

namespace interneuron::netns {

// For the names of tests.
inline void PrintTo(Backend backend, std::ostream* out) { *out << backend_name(backend); }

// A runtime directory of its own, removed at the end.
class RuntimeDir {
 public:
  RuntimeDir();
  ~RuntimeDir();
  RuntimeDir(const RuntimeDir&) = delete;
  RuntimeDir& operator=(const RuntimeDir&) = delete;

  const std::filesystem::path& path() const { return path_; }
  bool empty() const { return std::filesystem::is_empty(path_); }

 private:
  std::filesystem::path path_;
};

// One link "clean": 20 ms, 100 Mbit/s, no loss.
TestbedOptions clean_options(const RuntimeDir& dir);

// Why no testbed can be made here, if so.
std::optional<std::string> why_not();

// Polls until `condition` holds; false after the bound.
bool eventually(const std::function<bool()>& condition,
                std::chrono::milliseconds bound = std::chrono::seconds(5));

// The exit code of `body` in a child process; 255 when it threw.
int in_child(const std::function<int()>& body);

// Standard output of a command in one host. Its exit code goes to `code`, if given.
std::string output_of(const State& state, Host host, const std::vector<std::string>& argv,
                      int* code = nullptr);

// A UDP socket that lives in one host, bound to a NIC and port and, with `peer`, connected to it.
// The test keeps using it from outside, so that one process can hold both ends.
struct UdpOptions {
  std::string nic;
  std::string address;
  std::string peer;  // same port; empty: not connected
  int port = 7000;
};
io::FileDescriptor udp_socket_in(const State& state, Host host, const UdpOptions& options);

// Both ends of the link `index`, connected to each other.
struct UdpPair {
  io::FileDescriptor vehicle;
  io::FileDescriptor road;
};
UdpPair udp_pair(const State& state, std::size_t index = 0, int port = 7000);

// True when `fd` is readable within the bound.
bool readable(int fd, int bound_ms = 2000);

class NetnsTest : public testing::Test {
 protected:
  void SetUp() override {
    if (const auto reason = why_not()) GTEST_SKIP() << *reason;
  }
  RuntimeDir dir_;
};

}  // namespace interneuron::netns
