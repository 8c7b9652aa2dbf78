// Measures how many packets a second the testbed carries and how exact its delays are, beside the
// kernel's own veth on the same machine in the same run:
//
//   build/release/bench/testbed_bench [--backend emulator|netem] [--seconds S]
//
//   veth      core -> roadside unit: one plain veth pair, no link
//   link      vehicle -> roadside unit over one link of 20 ms and 10 Gbit/s, no loss
//
// Throughput: datagrams of 1400 bytes at rising paces until more than 0.1 % are lost. Precision:
// 500 datagrams a second. One process sends and one receives, beside the holder of the testbed.
// Ends with 0, or with TestbedError's code when the testbed cannot be made.
#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <thread>
#include <vector>

#include "app/process/failure.h"
#include "app/process/private_folder.h"
#include "app/process/whole_file.h"
#include "interneuron/sizes.h"
#include "netns/state/check.h"
#include "netns/state/error.h"
#include "netns/state/hosts.h"
#include "netns/state/options.h"
#include "netns/state/scenario.h"
#include "netns/state/snapshot.h"
#include "netns/state/state.h"
#include "netns/testbed/testbed.h"
#include "node/io/file_descriptor.h"

namespace interneuron::bench {
namespace {

using namespace netns;

// Bytes of UDP payload, and of the IP packet around it.
constexpr std::size_t kDatagram = kMaxDatagramBytes;
constexpr std::size_t kIpBytes = kDatagram + kIpv4UdpBytes;
// Datagrams per system call.
constexpr int kBatch = 32;
// Socket buffers, in bytes. No measurement is behind this value: it only has to be so large that
// neither end of the flow is what loses packets.
constexpr int kBufferBytes = 16 << 20;
constexpr std::uint16_t kPort = 7400;
// The one-way delay of kProfile.
constexpr double kLinkMs = 20;
// A pace with a larger share of lost packets is not carried.
constexpr double kBearableLoss = 0.001;

constexpr const char* kProfile = R"(# Source: the benchmark
schema = 1
name = "bench"
description = "20 ms, 10 Gbit/s"
model = "constant"
rtt_ms = 40
loss = 0
[up]
rate_mbit = 10000
[down]
rate_mbit = 10000
)";

std::int64_t now_ns() {
  timespec t{};
  ::clock_gettime(CLOCK_MONOTONIC, &t);
  return std::int64_t{t.tv_sec} * 1'000'000'000 + t.tv_nsec;
}

// A flow from one host to the first roadside unit. With `from_nic` the sender is bound to that NIC.
struct Flow {
  Host from;
  std::string from_nic;
  std::string from_address;
  std::string to_address;
};

sockaddr_in address(const std::string& text) {
  sockaddr_in out{};
  out.sin_family = AF_INET;
  out.sin_port = htons(kPort);
  ::inet_pton(AF_INET, text.c_str(), &out.sin_addr);
  return out;
}

io::FileDescriptor socket_on(const std::string& local) {
  io::FileDescriptor fd(check(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0), "open a socket"));
  // Only real root may exceed the system's limit; otherwise the kernel cuts the size to that.
  for (const int option : {SO_RCVBUFFORCE, SO_RCVBUF, SO_SNDBUFFORCE, SO_SNDBUF}) {
    ::setsockopt(fd.get(), SOL_SOCKET, option, &kBufferBytes, sizeof kBufferBytes);
  }
  const sockaddr_in bound = address(local);
  check(::bind(fd.get(), reinterpret_cast<const sockaddr*>(&bound), sizeof bound), "bind " + local);
  return fd;
}

// What became of one flow.
struct Result {
  std::uint64_t sent = 0;
  std::uint64_t received = 0;
  // Packets that arrived after one with a higher number.
  std::uint64_t out_of_order = 0;
  // Between the first and the last arrival.
  double seconds = 0;
  // The one-way delays of all packets that arrived, sorted.
  std::vector<double> delay_ms;

  double loss() const {
    return 1 -
           static_cast<double>(received) / static_cast<double>(std::max<std::uint64_t>(1, sent));
  }
  double quantile(double q) const {
    if (delay_ms.empty()) return 0;
    return delay_ms[static_cast<std::size_t>(q * static_cast<double>(delay_ms.size() - 1))];
  }
};

// The beginning of each payload. Both ends read the same clock, CLOCK_MONOTONIC.
struct Stamp {
  std::int64_t sent_ns;
  std::uint64_t number;
};

// The sending process: sends `pace` datagrams a second for `seconds`, each with its Stamp. Returns
// its exit code.
int send_flow(const Flow& flow, double pace, double seconds) {
  ::prctl(PR_SET_TIMERSLACK, 1UL);
  const io::FileDescriptor fd = socket_on(flow.from_address);
  if (!flow.from_nic.empty()) {
    ::setsockopt(fd.get(), SOL_SOCKET, SO_BINDTODEVICE, flow.from_nic.c_str(),
                 static_cast<socklen_t>(flow.from_nic.size()));
  }
  const sockaddr_in peer = address(flow.to_address);
  check(::connect(fd.get(), reinterpret_cast<const sockaddr*>(&peer), sizeof peer), "connect");
  std::vector<std::array<char, kDatagram>> payload(kBatch);
  std::array<iovec, kBatch> vectors{};
  std::array<mmsghdr, kBatch> messages{};
  for (std::size_t i = 0; i < kBatch; ++i) {
    vectors[i] = {payload[i].data(), kDatagram};
    messages[i].msg_hdr.msg_iov = &vectors[i];
    messages[i].msg_hdr.msg_iovlen = 1;
  }
  const std::int64_t start = now_ns();
  const auto total = static_cast<std::uint64_t>(pace * seconds);
  std::uint64_t sent = 0;
  while (sent < total) {
    const auto due =
        static_cast<std::uint64_t>(static_cast<double>(now_ns() - start) * pace / 1e9) + 1;
    const auto count = static_cast<unsigned>(
        std::min<std::uint64_t>({due > sent ? due - sent : 0, kBatch, total - sent}));
    for (unsigned i = 0; i < count; ++i) {
      const Stamp stamp{now_ns(), sent + i};
      std::memcpy(payload[i].data(), &stamp, sizeof stamp);
    }
    if (count > 0) {
      const int done = ::sendmmsg(fd.get(), messages.data(), count, 0);
      sent += done > 0 ? static_cast<std::uint64_t>(done) : 0;
    }
    const auto next = start + static_cast<std::int64_t>(static_cast<double>(sent) * 1e9 / pace);
    const std::int64_t wait = next - now_ns();
    if (wait > 0) {
      const timespec pause{0, static_cast<long>(std::min<std::int64_t>(wait, 999'999'999))};
      ::nanosleep(&pause, nullptr);
    }
  }
  return 0;
}

// The receiving process: writes a byte to `ready`, receives until nothing comes for 0.5 s, and
// writes counts and delays to `out`. Returns its exit code.
int receive_flow(const Flow& flow, int ready, const std::filesystem::path& out) {
  const io::FileDescriptor fd = socket_on(flow.to_address);
  std::vector<std::array<char, kDatagram>> buffers(kBatch);
  std::array<iovec, kBatch> vectors{};
  std::array<mmsghdr, kBatch> messages{};
  for (std::size_t i = 0; i < kBatch; ++i) {
    vectors[i] = {buffers[i].data(), kDatagram};
    messages[i].msg_hdr.msg_iov = &vectors[i];
    messages[i].msg_hdr.msg_iovlen = 1;
  }
  Result result;
  std::uint64_t next = 0;
  std::int64_t first = 0;
  std::int64_t last = 0;
  std::vector<double> delays;
  check(static_cast<int>(::write(ready, "r", 1)), "say ready");
  while (true) {
    // Up to 5 s for the first packet, as the sender is only starting; 0.5 s after that.
    timeval patience{result.received == 0 ? 5 : 0, result.received == 0 ? 0 : 500'000};
    ::setsockopt(fd.get(), SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    const int count = ::recvmmsg(fd.get(), messages.data(), kBatch, MSG_WAITFORONE, nullptr);
    if (count <= 0) break;
    last = now_ns();
    if (first == 0) first = last;
    for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
      Stamp stamp{};
      std::memcpy(&stamp, buffers[i].data(), sizeof stamp);
      if (stamp.number < next) ++result.out_of_order;
      next = std::max(next, stamp.number + 1);
      delays.push_back(static_cast<double>(last - stamp.sent_ns) / 1e6);
    }
    result.received += static_cast<std::uint64_t>(count);
  }
  std::sort(delays.begin(), delays.end());
  std::ofstream file(out, std::ios::binary);
  const double seconds = static_cast<double>(last - first) / 1e9;
  file << result.received << ' ' << result.out_of_order << ' ' << seconds << '\n';
  for (const double d : delays) file << d << '\n';
  return file ? 0 : 1;
}

// Forks a process that enters `host`, runs `body` and ends with what that returns.
template <class Body>
pid_t child_in(const State& state, Host host, Body body) {
  const pid_t child = check(::fork(), "fork");
  if (child > 0) return child;
  try {
    Testbed::enter(state, host);
    ::_exit(body());
  } catch (const std::exception& error) {
    fmt::print(stderr, "{}\n", error.what());
    ::_exit(1);
  }
}

Result run_flow(const State& state, const Flow& flow, double pace, double seconds) {
  const std::filesystem::path out = state.file.parent_path() / "received";
  std::array<int, 2> ends{};
  check(::pipe(ends.data()), "make a pipe");
  const pid_t receiver = child_in(state, kRoad, [&] { return receive_flow(flow, ends[1], out); });
  char ready = 0;
  check(static_cast<int>(::read(ends[0], &ready, 1)), "wait for the receiver");
  const pid_t sender = child_in(state, flow.from, [&] { return send_flow(flow, pace, seconds); });
  ::waitpid(sender, nullptr, 0);
  ::waitpid(receiver, nullptr, 0);
  ::close(ends[0]);
  ::close(ends[1]);
  Result result;
  result.sent = static_cast<std::uint64_t>(pace * seconds);
  std::ifstream file(out);
  file >> result.received >> result.out_of_order >> result.seconds;
  for (double d = 0; file >> d;) result.delay_ms.push_back(d);
  return result;
}

// Raises the pace until too much is lost, with a row per pace on stdout. Returns the highest rate
// that was carried, in packets per second.
double throughput(const State& state, const char* name, const Flow& flow, double seconds) {
  double best = 0;
  fmt::print("{:<6}{:>12}{:>12}{:>10}{:>9}{:>10}{:>10}{:>14}\n", name, "offered/s", "got/s",
             "Gbit/s", "loss %", "p50 ms", "p99 ms", "out of order");
  for (const double pace :
       {20e3, 40e3, 60e3, 80e3, 90e3, 100e3, 120e3, 140e3, 170e3, 200e3, 250e3}) {
    const Result r = run_flow(state, flow, pace, seconds);
    const double got = r.seconds > 0 ? static_cast<double>(r.received) / r.seconds : 0;
    fmt::print("{:<6}{:>12.0f}{:>12.0f}{:>10.3f}{:>9.3f}{:>10.3f}{:>10.3f}{:>14}\n", "", pace, got,
               got * static_cast<double>(kIpBytes) * 8 / 1e9, 100 * r.loss(), r.quantile(0.5),
               r.quantile(0.99), r.out_of_order);
    if (r.loss() > kBearableLoss || got < 0.97 * pace) break;
    best = got;
  }
  return best;
}

int bench(Backend backend, double seconds) {
  const process::PrivateFolder temporary("testbed-bench");
  const std::filesystem::path& folder = temporary.path();
  {
    process::write_whole(folder / "bench.toml", kProfile);
    TestbedOptions options;
    options.name = "bench";
    options.backend = backend;
    options.runtime_dir = folder;
    options.scenario = scenario_of({"bench=" + (folder / "bench.toml").string()}, 1);
    const Testbed testbed = Testbed::up(options);
    const State& state = testbed.state();
    const TestbedLink& link = state.links.front();
    const Flow veth{kCore, "", "10.77.0.254", link.road_address};
    const Flow over{kVehicle, link.nic, link.vehicle_address, link.road_address};
    fmt::print("back end {}, {} CPUs, {} s per pace\n\n", backend_name(state.backend),
               std::thread::hardware_concurrency(), seconds);
    const double veth_best = throughput(state, "veth", veth, seconds);
    fmt::print("\n");
    const double link_best = throughput(state, "link", over, seconds);
    const Result precise = run_flow(state, over, 500, 10);
    const Snapshot snapshot = testbed.snapshot();
    fmt::print(
        "\nveth {:.0f} packets/s, link {:.0f} packets/s = {:.3f} Gbit/s, ratio {:.2f}\n"
        "{} ms at 500 packets/s: error p50 {:+.3f} ms, p99 {:+.3f} ms, p99.9 {:+.3f} ms; {} of {} "
        "received\nemulator: lateness mean {:.1f} us, max {:.1f} us, kernel drops {}\n",
        veth_best, link_best, link_best * static_cast<double>(kIpBytes) * 8 / 1e9,
        veth_best > 0 ? link_best / veth_best : 0, kLinkMs, precise.quantile(0.5) - kLinkMs,
        precise.quantile(0.99) - kLinkMs, precise.quantile(0.999) - kLinkMs, precise.received,
        precise.sent, snapshot.lateness_mean_us, snapshot.lateness_max_us, snapshot.kernel_drops);
  }
  return 0;
}

}  // namespace
}  // namespace interneuron::bench

int main(int argc, char** argv) {
  using interneuron::netns::Backend;
  CLI::App app("Throughput and precision of the testbed beside plain veth");
  std::string backend = "auto";
  double seconds = 2;
  app.add_option("--backend", backend, "auto, netem or emulator")
      ->capture_default_str()
      ->check(CLI::IsMember({"auto", "netem", "emulator"}));
  app.add_option("--seconds", seconds, "Per pace")
      ->capture_default_str()
      ->check(CLI::Range(0.1, 60.0));
  CLI11_PARSE(app, argc, argv);
  try {
    return interneuron::bench::bench(backend == "netem"      ? Backend::kNetem
                                     : backend == "emulator" ? Backend::kEmulator
                                                             : Backend::kAuto,
                                     seconds);
  } catch (const interneuron::process::Failure& error) {
    fmt::print(stderr, "testbed_bench: {}\n", error.what());
    return error.code();
  } catch (const interneuron::netns::TestbedError& error) {
    fmt::print(stderr, "testbed_bench: {}\n", error.what());
    return error.exit_code;
  }
}
