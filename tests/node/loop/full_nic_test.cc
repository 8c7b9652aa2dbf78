// The NIC of the one who sends is the bottleneck: a road behind an Outbox whose socket takes no
// more than leaves, in virtual time.
#include <gtest/gtest.h>

#include <array>
#include <memory>
#include <numeric>

#include "core/base/earliest.h"
#include "interneuron/sizes.h"
#include "node/loop/outbox.h"
#include "tests/core/endpoint/pipe.h"

namespace interneuron::full_nic_test {
namespace {

constexpr DataRate kNicRate = DataRate::mbit(100);
constexpr DataRate kVehicleRate = DataRate::mbit(60);
constexpr Duration kOneWay = 15ms;
constexpr std::size_t kVehicles = 10;
constexpr std::size_t kRoad = kVehicles;

// A NIC behind a socket of 512 KiB, which is writable again when half of it is free.
class Nic final : public Transport {
 public:
  struct Sent {
    TimePoint left{};
    std::size_t to = 0;
    Bytes bytes;
  };

  BatchResult send(std::span<const Outgoing> batch) override {
    BatchResult result;
    for (const Outgoing& datagram : batch) {
      if (free_at - now >= kNicRate.transmit_time(kBuffer)) {
        result.would_block = true;
        break;
      }
      const std::size_t size = datagram.size() + kIpUdpBytes;
      free_at = std::max(free_at, now) + kNicRate.transmit_time(size);
      sent.push_back(
          {free_at, std::to_integer<std::size_t>(datagram.to.raw[0]), datagram.joined()});
      ++result.taken;
    }
    return result;
  }
  std::span<const Incoming> receive() override { return {}; }
  TransportCaps capabilities() const override { return {}; }
  TransportCounters counters() const override { return {}; }
  Address local_address() const override { return {}; }
  int native_handle() const override { return -1; }

  TimePoint writable_at() const { return free_at - kNicRate.transmit_time(kBuffer / 2); }

  static constexpr std::size_t kBuffer = 512 * 1024;
  TimePoint now{};
  TimePoint free_at{};
  std::vector<Sent> sent;
};

// Vehicles that ask a road for answers, each over a link of its own behind the road's one NIC.
class Crowd : Outbox::Source {
 public:
  Crowd() : road_(options_of(kRoad + 1), network_.now()) {
    outbox_.add(kFast, nic_);
    road_.add_link(now(), kFast, {"nic", 1500});
    PipelineConfig pipeline = pipeline_of({kComm, kComm});
    pipeline.policy = "best_link";
    pipeline.deadline = 150ms;
    pipeline.period = 100ms;
    const std::pair<LinkId, Address> to[] = {{kFast, address_of(kRoad)}};
    for (std::size_t i = 0; i < kVehicles; ++i) {
      const auto session = static_cast<std::uint32_t>(i + 1);
      vehicles_[i] = std::make_unique<Endpoint>(options_of(session, {pipeline}, false), now());
      vehicles_[i]->add_link(now(), kFast, {"nic", 1500});
      peers_[i] = vehicles_[i]->connect(now(), to);
      flush(i);
    }
    run(1s);
  }

  // Every vehicle asks so many times for an answer of this size, once in 100 ms.
  void ask(int count, std::size_t bytes) {
    answer_bytes_ = bytes;
    for (std::size_t vehicle = 0; vehicle < kVehicles; ++vehicle) {
      for (int i = 0; i < count; ++i) {
        const auto phase = static_cast<std::int64_t>(vehicle) * 1ms;
        network_.plan(now() + i * 100ms + phase, [this, vehicle] {
          Endpoint& e = *vehicles_[vehicle];
          const RoundRef round = e.begin_round(now(), PipelineId{0});
          e.submit(now(), round, {Bytes(1000)}, MessageClass::kData, peers_[vehicle]);
          flush(vehicle);
        });
      }
    }
    run(count * 100ms + 200ms);
  }

  std::array<int, kVehicles> on_time{};

 private:
  struct Packet {
    std::size_t from = 0;
    std::size_t to = 0;
    Bytes bytes;
  };

  TimePoint now() const { return network_.now(); }
  std::optional<TransmitParts> poll(TimePoint now, std::span<std::byte> buffer) override {
    return road_.poll_transmit_parts(now, buffer);
  }

  void run(Duration length) {
    const TimePoint end = now() + length;
    for (;;) {
      TimePoint next = std::min(end, network_.next().value_or(end));
      for (const auto& wake : wakes_) next = std::min(next, wake.value_or(end));
      if (next >= end) break;
      network_.move_to(next);
      network_.run([this](const Packet& p) {
        Endpoint& to = p.to == kRoad ? road_ : *vehicles_[p.to];
        to.handle_datagram(now(), {kFast, address_of(p.from), p.bytes});
        flush(p.to);
      });
      for (std::size_t i = 0; i <= kRoad; ++i) {
        if (!wakes_[i] || *wakes_[i] > now()) continue;
        (i == kRoad ? road_ : *vehicles_[i]).handle_timeout(now());
        flush(i);
      }
    }
    network_.move_to(end);
  }

  void flush(std::size_t host) {
    if (host == kRoad) return flush_road();
    Endpoint& vehicle = *vehicles_[host];
    while (auto event = vehicle.poll_event()) {
      const auto* done = std::get_if<RoundDone>(&*event);
      on_time[host] += done != nullptr && done->outcome == Outcome::kRemote ? 1 : 0;
    }
    std::array<std::byte, kMaxDatagramBytes> buffer;
    while (const auto t = vehicle.poll_transmit(now(), buffer)) {
      const ByteView bytes = ByteView(buffer).first(t->size);
      network_.send(now() + kOneWay, {host, kRoad, Bytes(bytes.begin(), bytes.end())});
    }
    wake(host, vehicle.next_timeout());
  }

  void flush_road() {
    while (auto event = road_.poll_event()) {
      const auto* asked = std::get_if<Delivered>(&*event);
      if (asked == nullptr) continue;
      road_.submit(now(), asked->round, {Bytes(answer_bytes_)}, MessageClass::kResult);
    }
    nic_.now = now();
    if (outbox_.blocked(kFast) && nic_.writable_at() <= now()) outbox_.writable(now(), kFast);
    while (outbox_.pump(now(), *this) == Outbox::More::kNow) {
    }
    for (Nic::Sent& sent : nic_.sent) {
      TimePoint& free_at = free_at_[sent.to];
      free_at = std::max(free_at, sent.left) +
                kVehicleRate.transmit_time(sent.bytes.size() + kIpUdpBytes);
      network_.send(free_at + kOneWay, {kRoad, sent.to, std::move(sent.bytes)});
    }
    nic_.sent.clear();
    wake(kRoad, earliest(road_.next_timeout(), outbox_.next_timeout(now())));
    if (outbox_.blocked(kFast)) wakes_[kRoad] = earliest(wakes_[kRoad], nic_.writable_at());
  }
  // A timer is 100 us late, so that one that is due again at once does not stop the time.
  void wake(std::size_t host, std::optional<TimePoint> at) {
    wakes_[host] = at ? std::optional(std::max(*at, now() + 100us)) : std::nullopt;
  }

  VirtualNetwork<Packet> network_;
  Endpoint road_;
  std::array<std::unique_ptr<Endpoint>, kVehicles> vehicles_;
  std::array<PeerId, kVehicles> peers_{};
  std::size_t answer_bytes_ = 0;
  std::array<std::optional<TimePoint>, kVehicles + 1> wakes_;
  // When the link of each vehicle is idle.
  std::array<TimePoint, kVehicles> free_at_{};
  Nic nic_;
  Outbox outbox_;
};

int sum(const std::array<int, kVehicles>& counts) {
  return std::accumulate(counts.begin(), counts.end(), 0);
}

// Offered to the NIC, with headers: 68 %, 106 % and 153 % of its rate.
TEST(FullNic, BelowItsRateEveryAnswerIsOnTime) {
  Crowd crowd;
  crowd.ask(30, 80'000);
  EXPECT_EQ(sum(crowd.on_time), 30 * static_cast<int>(kVehicles));
}

TEST(FullNic, AboveItsRateNotEveryAnswerIsLate) {
  for (const std::size_t bytes : {std::size_t{125'000}, std::size_t{180'000}}) {
    Crowd crowd;
    crowd.ask(100, bytes);
    std::printf("%zu bytes: %d of %zu on time\n", bytes, sum(crowd.on_time), 100 * kVehicles);
    // Two thirds of the larger ones would fit.
    EXPECT_GE(sum(crowd.on_time), 100 * static_cast<int>(kVehicles) / 4) << bytes;
  }
}

}  // namespace
}  // namespace interneuron::full_nic_test
