#include "lab/transport_costs/costs.h"

#include <net/if.h>
#include <poll.h>
#include <sched.h>
#include <sys/resource.h>

#include <algorithm>
#include <atomic>
#include <memory>
#include <thread>

#include "app/process/signals.h"
#include "netns/wiring/namespaces.h"
#include "netns/wiring/nics.h"
#include "node/io/open_transport.h"
#include "node/io/steady_clock.h"

namespace interneuron::transport_costs {
namespace {

using netns::NetworkNamespaceScope;
using TransportOwner = std::unique_ptr<interneuron::Transport>;

constexpr const char* kNic = "bench0";
constexpr std::array<const char*, 2> kHosts{"10.83.0.1", "10.83.0.2"};
constexpr std::array<const char*, 2> kMacs{"02:00:00:83:00:01", "02:00:00:83:00:02"};
// How long nothing may come until what has not come is lost. No measurement behind this value: it
// is far longer than a datagram takes over a veth pair.
constexpr int kQuietMs = 100;
// The kernel tells of a neighbour within this, or the machine is in trouble.
constexpr Duration kPatience = std::chrono::seconds(5);

// The two ends of a wire, each in a namespace of its own.
class Wire {
 public:
  Wire() : spaces_(netns::make_namespaces(1, 1)) {
    const auto socket = netns::netlink::open_socket();
    netns::make_pair(socket.get(), end(0), end(1));
    for (std::size_t i = 0; i < 2; ++i) set_up_end(i);
  }

  TransportOwner open(std::size_t side, TransportKind kind) const {
    const NetworkNamespaceScope scope(space(side), spaces_.air.get());
    io::UdpOptions options{.nic = kNic, .local = make_address(kHosts[side], 0).value()};
    return io::open_transport(kind, options).transport;
  }

 private:
  int space(std::size_t side) const {
    return (side == 0 ? spaces_.vehicles : spaces_.roads).front().get();
  }
  netns::NicEnd end(std::size_t side) const {
    return {.nic = kNic,
            .mac = kMacs[side],
            .network_namespace = space(side),
            .index = static_cast<int>(10 + side)};
  }
  // With the offloads that a veth pair has by itself, unlike the links of a testbed.
  void set_up_end(std::size_t side) {
    const NetworkNamespaceScope scope(space(side), spaces_.air.get());
    const auto socket = netns::netlink::open_socket();
    netns::set_up(socket.get(), kNic);
    const netns::NicPlan plan{.nic = kNic,
                              .mac = kMacs[side],
                              .addresses = {std::string(kHosts[side]) + "/24"},
                              .neighbours = {{kHosts[1 - side], kMacs[1 - side]}}};
    netns::configure(socket.get(), plan, static_cast<int>(::if_nametoindex(kNic)));
  }

  netns::Namespaces spaces_;
};

// The processor time of the calling thread, in microseconds.
double processor_us() {
  rusage used{};
  ::getrusage(RUSAGE_THREAD, &used);
  const auto us = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) * 1e6 + static_cast<double>(t.tv_usec);
  };
  return us(used.ru_utime) + us(used.ru_stime);
}

bool wait_for(const interneuron::Transport& transport, short events, int milliseconds) {
  pollfd item{.fd = transport.native_handle(), .events = events, .revents = 0};
  return ::poll(&item, 1, milliseconds) == 1;
}

// Gives the calling thread a processor of its own, the one of this number among those that the
// process may use; nothing changes where there is only one. Left to itself the scheduler puts both
// ends on one processor in some runs and apart in others, which changes a cost twofold.
void stay_on_processor(int number, const cpu_set_t& allowed) {
  if (CPU_COUNT(&allowed) < 2) return;
  for (std::size_t cpu = 0; cpu < CPU_SETSIZE; ++cpu) {
    if (!CPU_ISSET(cpu, &allowed) || number-- > 0) continue;
    cpu_set_t one;
    CPU_ZERO(&one);
    CPU_SET(cpu, &one);
    ::sched_setaffinity(0, sizeof one, &one);
    return;
  }
}

cpu_set_t allowed_processors() {
  cpu_set_t out;
  CPU_ZERO(&out);
  ::sched_getaffinity(0, sizeof out, &out);
  return out;
}

// Receives in a thread of its own on the second processor, as a Node does: when something is
// there it takes all of it. Until its end is asked for and nothing comes any more.
class Receiver {
 public:
  Receiver(interneuron::Transport& transport, const cpu_set_t& allowed)
      : thread_([this, &transport, &allowed] { run(transport, allowed); }) {}
  ~Receiver() {
    if (thread_.joinable()) finish();
  }
  Receiver(const Receiver&) = delete;
  Receiver& operator=(const Receiver&) = delete;

  void finish() {
    ended_ = true;
    thread_.join();
  }
  // The next two after finish().
  std::size_t received() const { return received_; }
  double us() const { return us_; }

 private:
  void run(interneuron::Transport& transport, const cpu_set_t& allowed) {
    stay_on_processor(1, allowed);
    const double before = processor_us();
    for (;;) {
      const bool last = ended_;
      if (!wait_for(transport, POLLIN, kQuietMs) && last) break;
      for (auto batch = transport.receive(); !batch.empty(); batch = transport.receive()) {
        received_ += batch.size();
      }
    }
    us_ = processor_us() - before;
  }

  std::atomic<bool> ended_ = false;
  std::size_t received_ = 0;
  double us_ = 0;
  std::thread thread_;
};

void send_all(interneuron::Transport& transport, std::span<const Outgoing> batch) {
  const TimePoint end = io::now() + kPatience;
  BatchResult result;
  do {
    result = transport.send(batch);
    if (result.gone != 0) throw IoError("the wire is gone", result.gone);
    batch = batch.subspan(result.taken);
    if (result.would_block) wait_for(transport, POLLOUT, kQuietMs);
  } while ((!batch.empty() || result.refused) && io::now() < end);
  if (!batch.empty() || result.refused) throw IoError("datagrams are refused for seconds", ENOBUFS);
}

struct Outcome {
  std::size_t sent = 0;
  std::size_t lost = 0;
  double send_us = 0;
  double receive_us = 0;
};

Outcome run(const Wire& wire, const Load& load, TransportKind kind, Duration length,
            const cpu_set_t& allowed) {
  const TransportOwner there = wire.open(1, kind);
  const TransportOwner here = wire.open(0, kind);
  const Bytes payload(load.bytes);
  const std::vector<Outgoing> burst(load.datagrams,
                                    {.to = there->local_address(), .head = payload});
  // What is done once, as learning the other end's hardware address, is no part of it.
  send_all(*here, burst);
  while (wait_for(*there, POLLIN, kQuietMs)) there->receive();
  Receiver receiver(*there, allowed);
  Outcome out;
  const double before = processor_us();
  const TimePoint begin = io::now();
  for (TimePoint at = begin; at < begin + length; at += load.interval) {
    process::SignalWatch::sleep(at - io::now());
    send_all(*here, burst);
    out.sent += burst.size();
  }
  const double sending = processor_us() - before;
  receiver.finish();
  out.lost = out.sent - std::min(out.sent, receiver.received());
  out.send_us = sending / static_cast<double>(out.sent);
  out.receive_us = receiver.us() / static_cast<double>(std::max<std::size_t>(1, out.sent));
  return out;
}

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  std::ranges::sort(values);
  return values[values.size() / 2];
}

}  // namespace

std::vector<Row> measure(Duration length,
                         const std::function<void(std::size_t, std::size_t)>& progress) {
  const Wire wire;
  const cpu_set_t allowed = allowed_processors();
  stay_on_processor(0, allowed);
  std::vector<Row> rows;
  for (const Load& load : kLoads) {
    for (const TransportKind transport : kTransports) {
      rows.push_back({.load = &load, .transport = transport});
    }
  }
  std::vector<std::vector<Outcome>> outcomes(rows.size());
  std::size_t done = 0;
  for (int repetition = 0; repetition < kRepetitions; ++repetition) {
    for (std::size_t i = 0; i < rows.size(); ++i) {
      progress(done++, rows.size() * kRepetitions);
      if (!rows[i].failure.empty()) continue;
      try {
        outcomes[i].push_back(run(wire, *rows[i].load, rows[i].transport, length, allowed));
      } catch (const IoError& error) {
        rows[i].failure = error.what();
      }
    }
  }
  for (std::size_t i = 0; i < rows.size(); ++i) {
    std::vector<double> send;
    std::vector<double> receive;
    for (const Outcome& o : outcomes[i]) {
      rows[i].sent += o.sent;
      rows[i].lost += o.lost;
      send.push_back(o.send_us);
      receive.push_back(o.receive_us);
    }
    if (!rows[i].failure.empty()) continue;
    rows[i].send_us = median(std::move(send));
    rows[i].receive_us = median(std::move(receive));
  }
  return rows;
}

}  // namespace interneuron::transport_costs
