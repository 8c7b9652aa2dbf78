// Endpoints joined by an in-memory pipe in virtual time: each link has a delay and can be cut, and
// each host its own clock. Link ids are the same at both ends; an address is the host's index.
#pragma once

#include <gtest/gtest.h>

#include <array>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <vector>

#include "core/wire/packet.h"
#include "interneuron/endpoint.h"
#include "tests/virtual_network.h"

namespace interneuron {

using namespace std::chrono_literals;

inline Address address_of(std::size_t host) {
  return {.raw = {static_cast<std::byte>(host)}, .size = 1};
}

inline EndpointOptions options_of(std::uint32_t session, std::vector<PipelineConfig> pipelines = {},
                                  bool accept_peers = true) {
  EndpointOptions o;
  o.session = SessionId{session};
  o.pipelines = std::move(pipelines);
  o.policies = builtin_policies();
  o.accept_peers = accept_peers;
  return o;
}

inline PipelineConfig pipeline_of(std::vector<StageKind> stages, std::uint8_t id = 0) {
  PipelineConfig p;
  p.id = PipelineId{id};
  p.stages = std::move(stages);
  p.guard = GuardKind::kPaper;
  return p;
}

inline constexpr StageKind kComm = StageKind::kCommunication;
inline constexpr StageKind kComp = StageKind::kComputation;
inline constexpr LinkId kFast{0};
inline constexpr LinkId kSlow{1};

class Pipe {
 public:
  struct Captured {
    std::size_t from = 0;
    LinkId link{};
    Bytes bytes;
    std::optional<RoundRef> round{};  // as Transmit tells it

    // A piece of a message.
    bool is_data() const {
      const auto packet = wire::parse(bytes);
      return packet && packet->header.type == wire::PacketType::kData;
    }
  };

  std::size_t add_host(EndpointOptions options, Duration clock_offset = {}) {
    hosts_.push_back({nullptr, clock_offset, std::nullopt, 0});
    restart(hosts_.size() - 1, std::move(options));
    return hosts_.size() - 1;
  }
  void restart(std::size_t host, EndpointOptions options) {
    hosts_[host].endpoint = std::make_unique<Endpoint>(std::move(options), local(host));
    for (const LinkId link : {kFast, kSlow}) at(host).add_link(local(host), link, {"nic", 1500});
  }
  PeerId connect(std::size_t from, std::size_t to) {
    const std::pair<LinkId, Address> addresses[] = {{kFast, address_of(to)},
                                                    {kSlow, address_of(to)}};
    const PeerId peer = at(from).connect(local(from), addresses);
    flush(from);
    return peer;
  }
  // The host's clock goes forward at once.
  void jump(std::size_t host, Duration by) {
    hosts_[host].offset += by;
    at(host).handle_timeout(local(host));
    flush(host);
  }
  Endpoint& at(std::size_t host) { return *hosts_[host].endpoint; }
  TimePoint local(std::size_t host) const { return network_.now() + hosts_[host].offset; }
  Duration now() const { return network_.now().time_since_epoch(); }
  void plan(Duration in, std::function<void()> action) {
    network_.plan(network_.now() + in, std::move(action));
  }

  // Begins a round and submits its message at once, if it has one.
  RoundRef round(std::size_t host, PipelineId pipeline = PipelineId{0},
                 Variants variants = {Bytes(1000)}, std::optional<PeerId> to = std::nullopt) {
    const RoundRef ref = at(host).begin_round(local(host), pipeline);
    submitted = at(host).submit(local(host), ref, std::move(variants), MessageClass::kData, to);
    flush(host);
    return ref;
  }
  SubmitStatus submit(std::size_t host, const RoundRef& ref, std::size_t bytes,
                      std::optional<PeerId> to = std::nullopt) {
    const SubmitStatus status =
        at(host).submit(local(host), ref, {Bytes(bytes)}, MessageClass::kResult, to);
    flush(host);
    return status;
  }

  void run(Duration time) {
    const TimePoint end = network_.now() + time;
    for (;;) {
      TimePoint next = std::min(end, network_.next().value_or(end));
      for (const Host& h : hosts_) next = std::min(next, h.wake.value_or(end));
      if (next >= end) break;
      step(next);
    }
    network_.move_to(end);
  }

  std::function<void(std::size_t host, Event&)> on_event;
  std::function<void(std::size_t from, std::size_t to, LinkId, const Bytes&)> on_transmit;
  std::map<LinkId, Duration> delay{{kFast, 5ms}, {kSlow, 10ms}};  // one way
  std::map<LinkId, Duration> extra_from_0;                        // on top, of what host 0 sends
  std::set<LinkId> cut;
  // Whether a packet is lost, and how much longer than `delay` it takes, on top.
  std::function<bool(std::size_t from, LinkId link, ByteView bytes)> drop;
  std::function<Duration()> jitter;
  // How many times in a row a timer may be due again at its own instant: where round trips vary, a
  // path's time-out may move into the past while another one is handled.
  int spins_allowed = 0;
  std::vector<Captured>* capture = nullptr;
  // What submit() answered to the message of the newest round().
  SubmitStatus submitted = SubmitStatus::kUnknownRound;

  void flush(std::size_t id) {
    Host& host = hosts_[id];
    for (int i = 0; i < 2; ++i) {
      while (auto event = host.endpoint->poll_event()) {
        if (on_event) on_event(id, *event);
      }
      std::array<std::byte, kMaxDatagramBytes> buffer;
      while (const auto t = host.endpoint->poll_transmit(local(id), buffer)) {
        const Bytes bytes(buffer.begin(), buffer.begin() + static_cast<std::ptrdiff_t>(t->size));
        const auto to = std::to_integer<std::size_t>(t->to.raw[0]);
        if (capture != nullptr) capture->push_back({id, t->link, bytes, t->round});
        if (on_transmit) on_transmit(id, to, t->link, bytes);
        if (cut.contains(t->link) || (drop && drop(id, t->link, bytes))) continue;
        const Duration extra =
            id == 0 && extra_from_0.contains(t->link) ? extra_from_0.at(t->link) : 0ns;
        const Duration late = jitter ? jitter() : 0ns;
        network_.send(network_.now() + delay.at(t->link) + extra + late, {to, id, t->link, bytes});
      }
    }
    const auto next = host.endpoint->next_timeout();
    host.wake = next ? std::optional(*next - host.offset) : std::nullopt;
    if (!next) return;
    // A timer that is due after everything was drained would be a loop that never sleeps.
    const bool again = *host.wake <= network_.now() && just_timed_out_;
    host.spins = again ? host.spins + 1 : 0;
    if (host.spins > spins_allowed) ADD_FAILURE() << "host " << id << " spins";
  }

 private:
  struct Host {
    std::unique_ptr<Endpoint> endpoint;
    Duration offset{};
    std::optional<TimePoint> wake;  // by the network's clock
    int spins = 0;
  };
  struct InFlight {
    std::size_t to = 0;
    std::size_t from = 0;
    LinkId link{};
    Bytes bytes;
  };

  void step(TimePoint next) {
    network_.move_to(next);
    network_.run([this](const InFlight& f) {
      if (f.to >= hosts_.size()) return;
      at(f.to).handle_datagram(local(f.to), {f.link, address_of(f.from), f.bytes});
      flush(f.to);
    });
    for (std::size_t id = 0; id < hosts_.size(); ++id) {
      if (!hosts_[id].wake || *hosts_[id].wake > network_.now()) continue;
      at(id).handle_timeout(local(id));
      just_timed_out_ = true;
      flush(id);
      just_timed_out_ = false;
    }
  }

  std::vector<Host> hosts_;
  VirtualNetwork<InFlight> network_;
  bool just_timed_out_ = false;
};

}  // namespace interneuron
