// What a message costs two Endpoints without sockets, in virtual time: processor time of the sender
// and of the receiver, and how often each asks the heap for memory.
//
//   build/release/bench/message_bench [--bytes N] [--messages N] [--rounds] [--encrypted]
//
// Every message takes one link of 1 ms and no bottleneck, 50 a second, and the receiver's answers
// take the same way back. Datagrams come in batches of 32, as from a socket; what carries them from
// one side to the other is not counted, and neither is the message that the application makes.
// The time is that of all calls of an endpoint; what reading the clock around each takes is
// measured before and taken off.
#include <fmt/format.h>
#include <malloc.h>
#include <sodium.h>

#include <CLI/CLI.hpp>
#include <array>
#include <cstdlib>
#include <memory>
#include <new>
#include <vector>

#include "bench/cpu_time.h"
#include "interneuron/endpoint.h"
#include "interneuron/sizes.h"
#include "lab/sim/trust.h"

namespace {

bool is_counting = false;
std::uint64_t allocations = 0;

}  // namespace

[[gnu::noinline]] void* operator new(std::size_t size) {
  if (is_counting) ++allocations;
  void* block = std::malloc(size);
  if (block == nullptr) throw std::bad_alloc();
  return block;
}
[[gnu::noinline]] void operator delete(void* p) noexcept { std::free(p); }
[[gnu::noinline]] void operator delete(void* p, std::size_t) noexcept { std::free(p); }

namespace interneuron::bench {
namespace {

using namespace std::chrono_literals;

constexpr Duration kDelay = 1ms;
constexpr Duration kPeriod = 20ms;
// Messages before the measurement: the estimates settle and buffers grow.
constexpr std::size_t kWarmUp = 100;
// Datagrams between two looks at what the receiver has to send.
constexpr std::size_t kBatch = 32;

struct Options {
  std::size_t bytes = 256 * 1024;
  std::size_t messages = 500;
  bool rounds = false;
  bool encrypted = false;
};

struct Packet {
  TimePoint at{};
  std::size_t size = 0;
  std::array<std::byte, kMaxDatagramBytes> bytes;
};

// One direction of the link; its memory is used again.
struct Line {
  std::vector<Packet> packets;
  std::size_t first = 0;
  std::size_t count = 0;
  Packet& at(std::size_t i) { return packets[(first + i) % packets.size()]; }
};

// What one side has cost.
struct Cost {
  double us = 0;
  std::uint64_t allocations = 0;
  std::uint64_t readings = 0;
};

class Bench {
 public:
  explicit Bench(const Options& options) : options_(options) {
    // Two messages at a time and what is sent beside them, in memory that stays in the caches as a
    // socket's buffers do.
    for (Line& line : lines_) line.packets.resize(2 * options_.bytes / kMaxPieceBytes + 1024);
    for (std::size_t side = 0; side < 2; ++side) {
      EndpointOptions o;
      o.session = SessionId{static_cast<std::uint32_t>(side + 1)};
      o.policies = builtin_policies();
      o.accept_peers = side == 1;
      if (options_.encrypted)
        o.security = sim::security_of(1 + static_cast<int>(side), {2 - static_cast<int>(side)});
      PipelineConfig pipeline{.stages = {StageKind::kCommunication, StageKind::kCommunication},
                              .policy = "best_link",
                              .guard = GuardKind::kPaper};
      if (side == 0) o.pipelines = {pipeline};
      ends_[side] = std::make_unique<Endpoint>(std::move(o), now_);
      ends_[side]->add_link(now_, LinkId{0}, {"nic", 1500, {}});
    }
    const std::pair<LinkId, Address> to[] = {{LinkId{0}, address(1)}};
    peer_ = ends_[0]->connect(now_, to);
    drain(0);
  }

  void run() {
    TimePoint next_message = now_ + 3s;
    std::size_t sent = 0;
    while (sent < kWarmUp + options_.messages || lines_[0].count > 0) {
      TimePoint next = sent < kWarmUp + options_.messages ? next_message : TimePoint::max();
      for (Line& line : lines_) {
        if (line.count > 0) next = std::min(next, line.at(0).at);
      }
      for (const auto& end : ends_) next = std::min(next, end->next_timeout().value_or(next));
      now_ = std::max(now_, next);
      if (now_ >= next_message && sent < kWarmUp + options_.messages) {
        next_message += kPeriod;
        if (sent++ == kWarmUp) costs_ = {};
        send();
      }
      for (std::size_t side = 0; side < 2; ++side) {
        deliver(side);
        measured(side, [&] { ends_[side]->handle_timeout(now_); });
        drain(side);
      }
    }
    const std::array<Cost, 2> spent = costs_;
    costs_ = {};
    constexpr int kReadings = 100'000;
    for (int i = 0; i < kReadings; ++i) {
      measured(0, [] {});
    }
    const double reading_us = costs_[0].us / kReadings;
    const double n = static_cast<double>(options_.messages);
    const auto us = [&](std::size_t side) {
      return (spent[side].us - reading_us * static_cast<double>(spent[side].readings)) / n;
    };
    fmt::print(
        "{} bytes: send {:.1f} µs, {:.1f} allocations; receive {:.1f} µs, {:.1f} allocations; "
        "{} of {} delivered\n",
        options_.bytes, us(0), static_cast<double>(spent[0].allocations) / n, us(1),
        static_cast<double>(spent[1].allocations) / n, delivered_, kWarmUp + options_.messages);
  }

 private:
  static Address address(std::size_t side) {
    Address a;
    a.raw[0] = static_cast<std::byte>(side);
    a.size = 1;
    return a;
  }

  template <class Body>
  void measured(std::size_t side, const Body& body) {
    is_counting = true;
    const std::uint64_t before = allocations;
    const double from = thread_us();
    body();
    const double us = thread_us() - from;
    is_counting = false;
    ++costs_[side].readings;
    costs_[side].allocations += allocations - before;
    costs_[side].us += us;
  }

  void send() {
    Variants variants;
    variants.emplace_back(options_.bytes);
    measured(0, [&] {
      if (options_.rounds) {
        const RoundRef round = ends_[0]->begin_round(now_, PipelineId{0});
        ends_[0]->submit(now_, round, std::move(variants), MessageClass::kData, peer_);
      } else {
        ends_[0]->send(now_, peer_, std::move(variants), {.deadline = 100ms});
      }
    });
  }

  void deliver(std::size_t side) {
    Line& line = lines_[1 - side];
    while (line.count > 0 && line.at(0).at <= now_) {
      measured(side, [&] {
        for (std::size_t i = 0; i < kBatch && line.count > 0 && line.at(0).at <= now_; ++i) {
          const Packet& p = line.at(0);
          ends_[side]->handle_datagram(
              now_, {LinkId{0}, address(1 - side), ByteView(p.bytes).first(p.size)});
          line.first = (line.first + 1) % line.packets.size();
          --line.count;
        }
      });
      drain(side);
    }
  }

  // Nothing is copied between the two readings of the clock but what the endpoint writes.
  void drain(std::size_t side) {
    Line& line = lines_[side];
    for (bool more = true; more;) {
      measured(side, [&] {
        for (std::size_t i = 0; i < kBatch; ++i) {
          Packet& packet = line.at(line.count);
          const auto t = ends_[side]->poll_transmit(now_, packet.bytes);
          more = t.has_value();
          if (!more) break;
          packet.at = now_ + kDelay;
          packet.size = t->size;
          ++line.count;
        }
      });
    }
    for (bool more = true; more;) {
      std::optional<Event> event;
      measured(side, [&] { event = ends_[side]->poll_event(); });
      more = event.has_value();
      if (more &&
          (std::holds_alternative<Delivered>(*event) || std::holds_alternative<Message>(*event))) {
        ++delivered_;
      }
    }
  }

  const Options& options_;
  TimePoint now_{1s};
  std::array<Line, 2> lines_;
  std::array<std::unique_ptr<Endpoint>, 2> ends_;
  std::array<Cost, 2> costs_;
  PeerId peer_{};
  std::uint64_t delivered_ = 0;
};

}  // namespace
}  // namespace interneuron::bench

int main(int argc, char** argv) {
  // What malloc gives back to the kernel after one message it would have to fetch again for the
  // next one, which has to do with the order of frees in this program and not with endpoints. To
  // set the one ends that malloc learns the other, by which it would map each message of 128 KiB
  // anew.
  mallopt(M_TRIM_THRESHOLD, 64 << 20);
  mallopt(M_MMAP_THRESHOLD, 32 << 20);
  interneuron::bench::Options options;
  CLI::App app("What a message costs two endpoints without sockets.");
  app.add_option("--bytes", options.bytes, "Bytes of a message");
  app.add_option("--messages", options.messages, "Messages that are measured");
  app.add_flag("--rounds", options.rounds, "Messages of rounds instead of plain ones");
  app.add_flag("--encrypted", options.encrypted, "Packets are encrypted");
  CLI11_PARSE(app, argc, argv);
  // It chooses the code that this processor runs fastest.
  if (::sodium_init() < 0) return 1;
  interneuron::bench::Bench(options).run();
  return 0;
}
