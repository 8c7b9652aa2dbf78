// What a peer costs the Endpoint that serves it: processor time per packet that comes in, and
// memory. Vehicles and the endpoint under test (the road) are Endpoints alone, without sockets, in
// virtual time; every vehicle sends messages at a steady rate, interleaved with all others.
//
// Time runs in slices of one link delay: first every vehicle runs through the slice by itself, then
// the road. Nothing that one sends in a slice reaches the other before the next one, so the order
// of events is that of a real network, and the road's caches are not shared with the vehicles'.
//
// The time of a packet is what the processor spends on all that the road does in a slice (inputs,
// timers, polls, answers) divided by the packets that came in; time in which others have the
// processor does not count. The memory of a peer is what the road holds on the heap,
// without the bytes of incomplete messages, divided by the number of peers. They have joined when
// the road knows all of them, which all ask for at one instant.
//
// With --shards the road is several endpoints, between which packets are divided as sockets do it
// (node/io/socket_group.h): the time of a packet is then still that of all, and that of the busiest
// of those that serve is told beside it. With --encrypted all have keys.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <memory>
#include <new>
#include <optional>
#include <vector>

#include "interneuron/endpoint.h"
#include "lab/sim/trust.h"
#include "node/io/socket_group.h"

namespace {

// Bytes that were allocated less those that were freed while is_counting.
bool is_counting = false;
std::int64_t held_bytes = 0;
// Every block begins with its size, and glibc keeps 8 bytes of its own beside it.
constexpr std::size_t kPrefix = alignof(std::max_align_t);
constexpr std::size_t kOfTheAllocator = 8;

}  // namespace

[[gnu::noinline]] void* operator new(std::size_t size) {
  auto* block = static_cast<std::byte*>(std::malloc(size + kPrefix));
  if (block == nullptr) throw std::bad_alloc();
  std::memcpy(block, &size, sizeof(size));
  if (is_counting) held_bytes += static_cast<std::int64_t>(size + kOfTheAllocator);
  return block + kPrefix;
}
[[gnu::noinline]] void operator delete(void* p) noexcept {
  if (p == nullptr) return;
  std::byte* block = static_cast<std::byte*>(p) - kPrefix;
  std::size_t size = 0;
  std::memcpy(&size, block, sizeof(size));
  if (is_counting) held_bytes -= static_cast<std::int64_t>(size + kOfTheAllocator);
  std::free(block);
}
[[gnu::noinline]] void operator delete(void* p, std::size_t) noexcept { operator delete(p); }

namespace interneuron::bench {
namespace {

using namespace std::chrono_literals;

// The one-way delay of every link, and so the length of a slice.
constexpr Duration kSlice = 10ms;
constexpr std::uint32_t kRoadSession = 1U << 31U;

struct Options {
  std::vector<std::size_t> peers{1, 10, 100, 1000};
  std::uint8_t links = 2;
  std::size_t message_bytes = 5000;
  std::size_t answer_bytes = 0;
  double hertz = 10;
  // Before the first message peers meet and measure their links.
  double meet_s = 2;
  double warm_up_s = 0.5;
  double seconds = 1;
  std::uint8_t shards = 1;
  bool encrypted = false;
};

struct Packet {
  TimePoint at{};
  LinkId link{};
  // The number of the vehicle that sent it or that it goes to.
  std::uint32_t vehicle = 0;
  std::uint16_t size = 0;
  std::array<std::byte, kMaxDatagramBytes> bytes;
};

Duration seconds(double s) { return Duration{static_cast<std::int64_t>(s * 1e9)}; }

Address address_of(std::uint32_t host) {
  Address a;
  std::memcpy(a.raw.data(), &host, sizeof(host));
  a.size = sizeof(host);
  return a;
}

std::uint32_t host_of(const Address& address) {
  std::uint32_t host = 0;
  std::memcpy(&host, address.raw.data(), sizeof(host));
  return host;
}

EndpointOptions options_of(std::uint32_t session) {
  EndpointOptions o;
  o.session = SessionId{session};
  o.policies = builtin_policies();
  return o;
}

// What has left a host in a slice; only the bytes that are used are copied.
using Outbox = std::vector<Packet>;

void drain(Endpoint& endpoint, TimePoint now, std::uint32_t self, Outbox& out) {
  std::array<std::byte, kMaxDatagramBytes> buffer;
  while (const auto t = endpoint.poll_transmit(now, buffer)) {
    Packet& packet = out.emplace_back();
    packet.at = now + kSlice;
    packet.link = t->link;
    packet.vehicle = self == kRoadSession ? host_of(t->to) : self;
    packet.size = static_cast<std::uint16_t>(t->size);
    std::memcpy(packet.bytes.data(), buffer.data(), t->size);
  }
}

TimePoint wake_of(const Endpoint& endpoint, TimePoint now) {
  return std::max(endpoint.next_timeout().value_or(TimePoint::max()), now + Duration{1});
}

constexpr int kRoadHost = 1;
int host_number(std::uint32_t vehicle) { return static_cast<int>(vehicle) + kRoadHost; }

class Vehicle {
 public:
  Vehicle(const Options& options, TimePoint now, std::uint32_t number, TimePoint first_message)
      : options_(options), number_(number), next_message_(first_message) {
    EndpointOptions o = options_of(number);
    if (options.encrypted) o.security = sim::security_of(host_number(number), {kRoadHost});
    PipelineConfig pipeline{.stages = {StageKind::kCommunication, StageKind::kCommunication},
                            .policy = "best_link"};
    // The books of the other guard are kept per pipeline and not per peer.
    pipeline.guard = GuardKind::kPaper;
    o.pipelines = {pipeline};
    endpoint_ = std::make_unique<Endpoint>(std::move(o), now);
    std::vector<std::pair<LinkId, Address>> addresses;
    for (std::uint8_t i = 0; i < options.links; ++i) {
      endpoint_->add_link(now, LinkId{i}, {"nic", 1500, {}});
      addresses.emplace_back(LinkId{i}, address_of(kRoadSession));
    }
    peer_ = endpoint_->connect(now, addresses);
    wake_ = now;
  }

  void run(TimePoint end, Outbox& out) {
    for (std::size_t next = 0;;) {
      const TimePoint arrival = next < inbox.size() ? inbox[next].at : TimePoint::max();
      const TimePoint now = std::min({arrival, wake_, next_message_});
      if (now >= end) break;
      if (arrival == now) {
        const Packet& p = inbox[next++];
        endpoint_->handle_datagram(
            now, {p.link, address_of(kRoadSession), ByteView(p.bytes).first(p.size)});
      } else if (next_message_ == now) {
        next_message_ += seconds(1 / options_.hertz);
        const RoundRef round = endpoint_->begin_round(now, PipelineId{0});
        endpoint_->submit(now, round, {Bytes(options_.message_bytes)}, MessageClass::kData, peer_);
      } else {
        endpoint_->handle_timeout(now);
      }
      while (endpoint_->poll_event()) {
      }
      drain(*endpoint_, now, number_, out);
      wake_ = wake_of(*endpoint_, now);
    }
    inbox.clear();
  }

  // What arrives in the next slice, in the order of time.
  std::vector<Packet> inbox;

 private:
  const Options& options_;
  std::uint32_t number_;
  std::unique_ptr<Endpoint> endpoint_;
  PeerId peer_{};
  TimePoint wake_{};
  TimePoint next_message_{};
};

// One of the endpoints of the road, and what comes to it in a slice.
struct Part {
  std::unique_ptr<Endpoint> endpoint;
  TimePoint wake{};
  std::vector<const Packet*> inbox;
  std::clock_t spent = 0;
};

class Road {
 public:
  Road(const Options& options, TimePoint now, std::size_t peers) : options_(options) {
    EndpointOptions o = options_of(kRoadSession);
    o.accept_peers = true;
    o.max_peers = peers;
    if (options.shards > 1) o.shard = {options.shards, 0, std::make_shared<SharedHoldings>()};
    std::vector<int> hosts;
    for (std::size_t i = 1; options.encrypted && i <= peers; ++i) {
      hosts.push_back(host_number(static_cast<std::uint32_t>(i)));
    }
    if (options.encrypted) o.security = sim::security_of(kRoadHost, hosts);
    for (std::uint8_t i = 0; i <= o.shard.count; ++i) {
      o.shard.index = i;
      if (i > 0 && options.encrypted) {
        auto security = std::make_shared<Security>(*o.security);
        security->seed = sim::secret_key(-i);
        o.security = std::move(security);
      }
      is_counting = true;
      parts_.push_back({std::make_unique<Endpoint>(o, now), now, {}, 0});
      for (std::uint8_t link = 0; link < options.links; ++link) {
        parts_.back().endpoint->add_link(now, LinkId{link}, {"nic", 1500, {}});
      }
      is_counting = false;
    }
  }

  void run(TimePoint end, const std::vector<Packet>& inbox, Outbox& out) {
    for (const Packet& packet : inbox) {
      const std::size_t to = options_.shards == 1
                                 ? 0
                                 : io::shard_of_packet(ByteView(packet.bytes).first(packet.size),
                                                       options_.shards, options_.encrypted);
      parts_[to].inbox.push_back(&packet);
    }
    for (Part& part : parts_) {
      is_counting = true;
      const std::clock_t begin = std::clock();
      run(part, end, out);
      part.spent += std::clock() - begin;
      is_counting = false;
    }
    packets_in += inbox.size();
    packets_out += out.size();
  }

  void begin_measuring() {
    for (Part& part : parts_) part.spent = 0;
    packets_in = packets_out = messages = 0;
  }
  std::size_t peers() const {
    std::size_t sum = 0;
    for (const Part& part : parts_) sum += part.endpoint->peers().size();
    return sum;
  }
  std::size_t reassembly_bytes() const { return parts_.front().endpoint->reassembly_bytes(); }
  // Of a processor, in microseconds: all, and the busiest that serves.
  double spent_us() const {
    double sum = 0;
    for (const Part& part : parts_) sum += us(part);
    return sum;
  }
  double busiest_us() const {
    double most = 0;
    for (std::size_t i = options_.shards == 1 ? 0 : 1; i < parts_.size(); ++i) {
      most = std::max(most, us(parts_[i]));
    }
    return most;
  }

  std::uint64_t packets_in = 0;
  std::uint64_t packets_out = 0;
  std::uint64_t messages = 0;

 private:
  static double us(const Part& part) {
    return static_cast<double>(part.spent) * 1e6 / CLOCKS_PER_SEC;
  }

  void run(Part& part, TimePoint end, Outbox& out) {
    Endpoint& endpoint = *part.endpoint;
    for (std::size_t next = 0;;) {
      const TimePoint arrival = next < part.inbox.size() ? part.inbox[next]->at : TimePoint::max();
      const TimePoint now = std::min(arrival, part.wake);
      if (now >= end) break;
      if (arrival == now) {
        const Packet& p = *part.inbox[next++];
        endpoint.handle_datagram(now,
                                 {p.link, address_of(p.vehicle), ByteView(p.bytes).first(p.size)});
        while (const auto letter = endpoint.poll_handed_on()) {
          parts_[letter->shard].endpoint->handle_datagram(
              now, {letter->link, letter->from, letter->bytes});
          parts_[letter->shard].wake = std::min(parts_[letter->shard].wake, now);
        }
      } else {
        endpoint.handle_timeout(now);
      }
      while (auto event = endpoint.poll_event()) {
        const auto* delivered = std::get_if<Delivered>(&*event);
        if (delivered == nullptr) continue;
        ++messages;
        if (options_.answer_bytes == 0) continue;
        endpoint.submit(now, delivered->round, {Bytes(options_.answer_bytes)},
                        MessageClass::kResult);
      }
      drain(endpoint, now, kRoadSession, out);
      part.wake = wake_of(endpoint, now);
    }
    part.inbox.clear();
  }

  const Options& options_;
  // The door where there are several, then those that serve.
  std::vector<Part> parts_;
};

void measure(const Options& options, std::size_t peers) {
  held_bytes = 0;
  TimePoint now{1s};
  Road road(options, now, peers);
  std::vector<Vehicle> vehicles;
  vehicles.reserve(peers);
  const double between_s = 1 / options.hertz / static_cast<double>(peers);
  for (std::size_t i = 0; i < peers; ++i) {
    const Duration turn = seconds(static_cast<double>(i) * between_s);
    vehicles.emplace_back(options, now, static_cast<std::uint32_t>(i + 1),
                          now + seconds(options.meet_s) + turn);
  }
  std::vector<Packet> up;
  std::vector<Packet> arriving;
  // More than leave in a slice, so that it does not grow while the road is measured.
  Outbox down;
  down.reserve(64 * (options.links + std::size_t{1}) * peers);
  const TimePoint begin = now;
  std::optional<double> joined_s;
  const auto run_for = [&](Duration time) {
    for (const TimePoint end = now + time; now < end; now += kSlice) {
      if (!joined_s && road.peers() == peers) joined_s = to_seconds(now - begin);
      up.clear();
      for (Vehicle& vehicle : vehicles) vehicle.run(now + kSlice, up);
      down.clear();
      road.run(now + kSlice, arriving, down);
      for (const Packet& packet : down) vehicles[packet.vehicle - 1].inbox.push_back(packet);
      std::ranges::stable_sort(up, {}, &Packet::at);
      arriving.swap(up);
    }
  };
  run_for(seconds(options.meet_s + options.warm_up_s));
  road.begin_measuring();
  run_for(seconds(options.seconds));
  const double us = road.spent_us();
  const double kib =
      static_cast<double>(held_bytes - static_cast<std::int64_t>(road.reassembly_bytes())) / 1024;
  fmt::print("{:5} peers: {:7.2f} µs a packet in, {:6.1f} % of a core, {:6.1f} KiB a peer; ",
             road.peers(), us / static_cast<double>(road.packets_in), us / options.seconds / 1e4,
             kib / static_cast<double>(peers));
  if (options.shards > 1) {
    fmt::print("{:.2f} µs a packet of the busiest shard; ",
               road.busiest_us() / static_cast<double>(road.packets_in));
  }
  fmt::print("{}; ", joined_s ? fmt::format("joined after {:.2f} s", *joined_s) : "not all joined");
  fmt::print("{:.0f} packets in, {:.0f} out, {:.0f} messages a second\n",
             static_cast<double>(road.packets_in) / options.seconds,
             static_cast<double>(road.packets_out) / options.seconds,
             static_cast<double>(road.messages) / options.seconds);
}

}  // namespace
}  // namespace interneuron::bench

int main(int argc, char** argv) {
  interneuron::bench::Options options;
  CLI::App app("What a peer costs an endpoint: time per packet in, and memory.");
  app.add_option("--peers", options.peers, "How many peers; a line for each number");
  app.add_option("--links", options.links, "Links of every peer")->check(CLI::Range(1, 8));
  app.add_option("--bytes", options.message_bytes, "Bytes of a message");
  app.add_option("--answer", options.answer_bytes, "Bytes of its answer; 0: there is none");
  app.add_option("--hertz", options.hertz, "Messages of each peer a second");
  app.add_option("--meet", options.meet_s, "Seconds before the first message");
  app.add_option("--warm-up", options.warm_up_s, "Seconds of messages before the measurement");
  app.add_option("--seconds", options.seconds, "Seconds measured");
  app.add_option("--shards", options.shards, "Endpoints that serve")->check(CLI::Range(1, 64));
  app.add_flag("--encrypted", options.encrypted, "All have keys");
  CLI11_PARSE(app, argc, argv);
  for (const std::size_t peers : options.peers) interneuron::bench::measure(options, peers);
  return 0;
}
