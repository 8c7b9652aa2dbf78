#include "app/doctor/measurements.h"

#include <fmt/format.h>
#include <poll.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <memory>
#include <optional>
#include <random>

#include "app/doctor/judge.h"
#include "app/process/signals.h"
#include "app/process/status_line.h"
#include "node/io/stamped_socket.h"
#include "node/io/steady_clock.h"
#include "node/monitor/link_monitor.h"

namespace interneuron::doctor {
namespace {

// A signal just before a wait does not end it, so waits are so short that nobody notices.
constexpr Duration kWaitAtMost = std::chrono::milliseconds(200);

SessionId any_session() {
  std::random_device random;
  SessionId session;
  while (session.value == 0) session.value = random();
  return session;
}

// One run of `doctor --nat-timeout`: a SilenceTest for each NIC, and its sockets.
class Measurement {
 public:
  Measurement(const io::HostFacts& facts, probe::Silence limit);
  std::vector<NatTimeout> run();

 private:
  struct Nic {
    NatTimeout result;
    probe::SilenceTest test;
    // One per flow.
    std::vector<std::unique_ptr<io::StampedSocket>> sockets;
    int send_error = 0;
    bool under_way() const { return result.cut_short.empty() && !test.done(); }
  };
  void open(const io::NicHostFacts& facts);
  void send_due(Nic& nic);
  void receive(Nic& nic);
  void watch_nics();
  void wait();
  bool under_way() const { return std::ranges::any_of(nics_, &Nic::under_way); }
  void show_left(bool first);

  Address peer_;
  probe::Silence limit_;
  TimePoint start_ = io::now();
  io::LinkMonitor monitor_;
  std::vector<Nic> nics_;
  // The seconds that the line on stderr shows at present.
  process::StatusLine line_;
  std::optional<std::int64_t> shown_;
  std::array<std::byte, 2048> buffer_;
};

Measurement::Measurement(const io::HostFacts& facts, probe::Silence limit)
    : peer_(facts.target), limit_(limit) {
  for (const io::NicHostFacts& nic : facts.nics) {
    if (is_usable(facts, nic) && is_routed(nic)) open(nic);
  }
}

void Measurement::open(const io::NicHostFacts& facts) {
  const std::string& name = facts.nic.name;
  monitor_.require_route(name, peer_);
  Nic nic{{.nic = name, .limit = limit_, .flows = {}, .cut_short = {}},
          probe::SilenceTest(limit_, any_session(), start_),
          {}};
  io::UdpOptions udp{.nic = name};
  // Where only a rule for the source address routes the peer through this NIC.
  udp.local =
      monitor_.required_source(name).value_or(*make_address(is_ipv6(peer_) ? "::" : "0.0.0.0", 0));
  try {
    while (nic.sockets.size() < nic.test.flows()) {
      nic.sockets.push_back(std::make_unique<io::StampedSocket>(udp));
    }
  } catch (const IoError& error) {
    nic.result.cut_short = error.what();
  }
  nics_.push_back(std::move(nic));
}

void Measurement::send_due(Nic& nic) {
  while (const auto sending = nic.test.poll(io::now(), buffer_)) {
    const int error =
        nic.sockets[sending->flow]->send(peer_, ByteView(buffer_).first(sending->size));
    if (error != 0) nic.send_error = error;
  }
}

void Measurement::receive(Nic& nic) {
  for (std::size_t flow = 0; flow < nic.sockets.size(); ++flow) {
    while (const auto datagram = nic.sockets[flow]->receive()) {
      if (datagram->from == peer_) nic.test.handle(datagram->at, flow, datagram->bytes);
    }
  }
}

// A flow that ended with its NIC or address was not ended by silence.
void Measurement::watch_nics() {
  for (const io::NicEvent& event : monitor_.update()) {
    const auto nic = std::ranges::find(nics_, event.nic, [](const Nic& n) { return n.result.nic; });
    if (nic == nics_.end() || !nic->under_way()) continue;
    if (event.to != NicState::kReady || event.new_incarnation) {
      nic->result.cut_short = "the card changed meanwhile: " + event.reason;
    }
  }
}

void Measurement::wait() {
  std::vector<pollfd> handles{{monitor_.native_handle(), POLLIN, 0}};
  TimePoint next = io::now() + kWaitAtMost;
  for (const Nic& nic : nics_) {
    if (!nic.under_way()) continue;
    for (const auto& socket : nic.sockets) handles.push_back({socket->native_handle(), POLLIN, 0});
    next = std::min(next, *nic.test.next_timeout());
  }
  const Duration left = std::max(next - io::now(), Duration::zero());
  const timespec time{.tv_sec = 0, .tv_nsec = static_cast<long>(left.count())};
  ::ppoll(handles.data(), handles.size(), &time, nullptr);
}

// A line in a terminal counts down; elsewhere one says it all.
void Measurement::show_left(bool first) {
  if (!first && !line_.live()) return;
  TimePoint end = io::now();
  std::string names;
  for (const Nic& nic : nics_) {
    if (!nic.under_way()) continue;
    end = std::max(end, nic.test.ends_at());
    names += (names.empty() ? "" : ", ") + nic.result.nic;
  }
  const auto left = std::chrono::ceil<std::chrono::seconds>(end - io::now()).count();
  if (names.empty() || shown_ == left) return;
  shown_ = left;
  const std::string text =
      fmt::format("{}: silent flows to {}, {} s left …", names, to_string(peer_), left);
  line_.show(text);
  if (!line_.live()) fmt::print(stderr, "{}\n", text);
}

std::vector<NatTimeout> Measurement::run() {
  const process::SignalWatch signals;
  show_left(true);
  while (under_way() && process::SignalWatch::last() == 0) {
    for (Nic& nic : nics_) {
      if (nic.under_way()) send_due(nic);
    }
    show_left(false);
    wait();
    watch_nics();
    for (Nic& nic : nics_) {
      if (nic.under_way()) receive(nic);
    }
  }
  line_.keep();
  std::vector<NatTimeout> results;
  for (Nic& nic : nics_) {
    nic.result.flows = nic.test.result();
    if (nic.under_way()) nic.result.cut_short = "interrupted";
    if (nic.result.cut_short.empty() && !nic.result.flows.answered && nic.send_error != 0) {
      nic.result.cut_short = std::string("cannot send: ") + std::strerror(nic.send_error);
    }
    results.push_back(std::move(nic.result));
  }
  return results;
}

}  // namespace

std::vector<NatTimeout> measure_nat_timeouts(const io::HostFacts& facts, probe::Silence limit) {
  return Measurement(facts, limit).run();
}

}  // namespace interneuron::doctor
