// The measuring tools ping, iperf3 and tcpdump: whether they are installed, their command lines,
// how they are started inside a testbed and ended, where their output goes, and the ports that tell
// flows of iperf3 apart.
//
// Errors: Failure with an exit code and a remedy. Not thread-safe: one thread starts and ends all,
// as the kernel ends a child with the thread that started it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <string>
#include <vector>

#include "app/process/child.h"
#include "app/process/private_folder.h"
#include "netns/state/hosts.h"
#include "netns/state/state.h"
#include "netns/verify/schedule.h"

namespace interneuron::netns::verify {

// Bytes of UDP payload in the flows of the window: small, so that they hardly make a queue.
inline constexpr std::size_t kSmallPayload = 100;
// IP bytes of an echo request: ping's 56 bytes of data with the headers of ICMP and IPv4.
inline constexpr std::size_t kPingIpBytes = 84;

// One iperf3 flow over one direction of a link. The server listens at the roadside for either
// direction; its port identifies the flow, also behind a NAT, which changes only the vehicle's.
struct IperfFlow {
  TestbedLink link;
  Direction direction = Direction::kUp;
  std::uint16_t port = 0;
  std::size_t payload_bytes = 0;
  double payload_bits_per_second = 0;
};

// The first server port of the window's flows and of the rate flows. IANA has assigned neither
// range; the 500 between them are enough for 250 links.
inline constexpr std::uint16_t kFirstPort = 46000;
inline constexpr std::uint16_t kFirstRatePort = 46500;
// The server port of the `slot`-th measured link; each link has two, one per direction.
std::uint16_t port_of(std::uint16_t first, std::size_t slot, Direction direction);

std::vector<std::string> iperf_server(const IperfFlow& flow);
// The client sends (or, downwards, lets the server send) for `seconds` and ends by itself.
std::vector<std::string> iperf_client(const IperfFlow& flow, int seconds);
// Captures the UDP packets of `ports` to its stdout; without `both_ways` only those that arrive at
// the NIC.
std::vector<std::string> tcpdump(const std::string& nic, const std::vector<std::uint16_t>& ports,
                                 bool both_ways);
std::vector<std::string> ping(const TestbedLink& link);
// Two requests in this direction, the second one a second after the first; all are over after
// kTwoPings even where a radio sleeps.
std::vector<std::string> two_pings(const TestbedLink& link, Direction direction);
inline constexpr Duration kTwoPings = std::chrono::seconds(4);

Host vehicle_of(const TestbedLink& link);
// The host that receives the packets of a direction.
Host receiver_of(const TestbedLink& link, Direction direction);

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
  Process(const State& state, Host host, const std::vector<std::string>& argv,
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

}  // namespace interneuron::netns::verify
