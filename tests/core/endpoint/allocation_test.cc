// Packets cost no allocation: two endpoints exchange data, feedback, heartbeats and trains, and the
// heap is asked for something per message only.
#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <memory>
#include <utility>
#include <vector>

#include "interneuron/endpoint.h"
#include "tests/counted_heap.h"

namespace interneuron::allocation_test {
namespace {

using namespace std::chrono_literals;

constexpr std::size_t kPiece = kMaxDatagramBytes - 48;

// Two endpoints and two links of 100 Mbit/s; nothing in here allocates once it is built.
class TwoHosts {
 public:
  explicit TwoHosts(GuardKind guard = GuardKind::kPaper, const char* policy = "best_link") {
    PipelineConfig pipeline{
        .stages = offload_stages(), .policy = policy, .guard = guard, .levels = levels_};
    pipeline.fallback.local = 0.1;
    EndpointOptions o{
        .session = SessionId{1}, .pipelines = {pipeline}, .policies = builtin_policies()};
    hosts_[0] = std::make_unique<Endpoint>(o, now_);
    o.session = SessionId{2};
    o.pipelines.clear();
    o.accept_peers = true;
    hosts_[1] = std::make_unique<Endpoint>(o, now_);
    for (const auto& host : hosts_) {
      for (const LinkId link : {LinkId{0}, LinkId{1}})
        host->add_link(now_, link, {"nic", 1500, {}});
    }
    const std::pair<LinkId, Address> to[] = {{LinkId{0}, address(1)}, {LinkId{1}, address(1)}};
    peer_ = hosts_[0]->connect(now_, to);
    for (Line& line : lines_) line.packets.resize(kLine);
    flush(0);
  }

  // Runs so long; every `period` a message of so many pieces, of which the road sends one back.
  void run(Duration length, std::size_t pieces = 0, Duration period = 100ms) {
    const TimePoint end = now_ + length;
    TimePoint next_message = now_;
    while (now_ < end) {
      TimePoint next = end;
      if (pieces > 0) next = std::min(next, next_message);
      for (const Line& line : lines_) {
        if (line.count > 0) next = std::min(next, line.packets[line.first].due);
      }
      for (const auto& host : hosts_) next = std::min(next, host->next_timeout().value_or(end));
      now_ = std::max(now_ + 1us, next);
      for (std::size_t i = 0; i < lines_.size(); ++i) deliver(i);
      if (pieces > 0 && now_ >= next_message) {
        next_message += period;
        send(pieces);
        ++messages;
      }
      for (std::size_t host = 0; host < 2; ++host) {
        hosts_[host]->handle_timeout(now_);
        flush(host);
      }
    }
  }

  // What a round's first decision asks of the heap: the mode and the plan.
  std::uint64_t allocations_of_preview() {
    const RoundRef round = hosts_[0]->begin_round(now_, PipelineId{0});
    const std::size_t sizes[] = {100'000, 25'000};
    const std::uint64_t before = allocations;
    const Plan plan = hosts_[0]->preview(now_, round, sizes, MessageClass::kData, {}, peer_);
    EXPECT_FALSE(plan.sends.empty());
    return allocations - before;
  }

  // What the road holds on the heap; it is gone then.
  std::int64_t heap_of_road() {
    const std::int64_t before = held_bytes;
    hosts_[1].reset();
    return before - held_bytes;
  }

  std::uint64_t level_allocations = 0;  // of the last choice
  std::uint64_t levels_chosen = 0;
  std::uint64_t packets = 0;
  std::uint64_t messages = 0;
  std::uint64_t answered = 0;
  std::uint64_t lose_each = 0;  // 0: nothing is lost
  bool plain = false;           // messages instead of rounds, which nobody answers
  SendOptions how{.deadline = 90ms};

 private:
  static constexpr std::size_t kLine = 8192;
  static constexpr Duration kDelay = 10ms;
  static constexpr DataRate kRate{100'000'000};

  struct Packet {
    TimePoint due{};
    std::size_t size = 0;
    std::array<std::byte, kMaxDatagramBytes> bytes;
  };
  struct Line {  // one direction of one link
    std::vector<Packet> packets;
    std::size_t first = 0;
    std::size_t count = 0;
    TimePoint free_at{};
  };

  static Address address(std::size_t host) {
    Address a;
    a.raw[0] = static_cast<std::byte>(host);
    a.size = 1;
    return a;
  }
  Line& line(std::size_t from, LinkId link) { return lines_[from * 2 + link.value]; }

  void send(std::size_t pieces) {
    Bytes message(pieces * kPiece - 100);
    if (plain) {
      Variants variants;
      variants.push_back(std::move(message));
      hosts_[0]->send(now_, peer_, std::move(variants), how);
      return;
    }
    const RoundRef round = hosts_[0]->begin_round(now_, PipelineId{0});
    hosts_[0]->submit(now_, round, {std::move(message)}, MessageClass::kData, peer_);
  }

  void deliver(std::size_t which) {
    Line& l = lines_[which];
    const std::size_t from = which / 2;
    while (l.count > 0 && l.packets[l.first].due <= now_) {
      const Packet& packet = l.packets[l.first];
      hosts_[1 - from]->handle_datagram(
          now_, {LinkId{static_cast<std::uint8_t>(which % 2)}, address(from),
                 ByteView(packet.bytes).first(packet.size)});
      l.first = (l.first + 1) % kLine;
      --l.count;
    }
  }
  void flush(std::size_t host) {
    while (auto event = hosts_[host]->poll_event()) {
      if (const auto* delivered = std::get_if<Delivered>(&*event)) {
        const std::uint64_t before = allocations;
        hosts_[host]->begin_computation(now_, delivered->round, levels_, 1);
        level_allocations = allocations - before;
        ++levels_chosen;
        hosts_[host]->submit(now_, delivered->round, {Bytes(kPiece - 100)}, MessageClass::kResult);
      } else if (std::holds_alternative<RoundDone>(*event) ||
                 std::holds_alternative<Message>(*event)) {
        ++answered;
      }
    }
    while (const auto t = hosts_[host]->poll_transmit(now_, buffer_)) {
      ++packets;
      if (lose_each > 0 && packets % lose_each == 0) continue;
      Line& l = line(host, t->link);
      l.free_at = std::max(l.free_at, now_) + kRate.transmit_time(t->size);
      ASSERT_LT(l.count, kLine);
      Packet& packet = l.packets[(l.first + l.count++) % kLine];
      packet.due = l.free_at + kDelay;
      packet.size = t->size;
      std::copy_n(buffer_.begin(), t->size, packet.bytes.begin());
    }
  }

  std::vector<LevelProfile> levels_{{1ms, 1ms, {0.3}}, {2ms, 2ms, {0.4}}};
  TimePoint now_{1s};
  std::array<std::unique_ptr<Endpoint>, 2> hosts_;
  PeerId peer_{};
  std::array<Line, 4> lines_;
  std::array<std::byte, kMaxDatagramBytes> buffer_;
};

struct Cost {
  std::uint64_t allocations = 0;
  std::uint64_t packets = 0;
  std::uint64_t messages = 0;
  double per_message() const {
    return static_cast<double>(allocations) / static_cast<double>(messages);
  }
};

Cost cost_of(TwoHosts& hosts, Duration length, std::size_t pieces, Duration period = 100ms) {
  const Cost before{allocations, hosts.packets, hosts.messages};
  hosts.run(length, pieces, period);
  return {allocations - before.allocations, hosts.packets - before.packets,
          hosts.messages - before.messages};
}

TEST(Allocation, HeartbeatsAndTrainsNeedNone) {
  TwoHosts hosts;
  hosts.run(30s, 100);
  hosts.run(30s);
  const Cost idle = cost_of(hosts, 120s, 0);
  EXPECT_GT(idle.packets, 1000U);
  EXPECT_EQ(idle.allocations, 0U);
}

// What the guard and the policy decide of a round: mode, plan and level.
TEST(Allocation, DecisionsNeedNone) {
  for (const GuardKind guard : {GuardKind::kPaper, GuardKind::kBudget}) {
    for (const char* policy : {"down_sampling", "joint", "placement", "duplicate"}) {
      TwoHosts hosts(guard, policy);
      hosts.run(10s, 100);
      EXPECT_GE(hosts.answered + 1, hosts.messages);
      EXPECT_EQ(hosts.allocations_of_preview(), 0U) << to_string(guard) << ' ' << policy;
      EXPECT_GT(hosts.levels_chosen, 0U);
      EXPECT_EQ(hosts.level_allocations, 0U) << to_string(guard) << ' ' << policy;
    }
  }
}

TEST(Allocation, DataAndFeedbackNeedNonePerPacket) {
  TwoHosts hosts;
  hosts.run(30s, 400);
  const Cost small = cost_of(hosts, 30s, 40);
  const Cost large = cost_of(hosts, 30s, 400);
  EXPECT_GE(hosts.answered + 1, hosts.messages);  // the last one is under way
  EXPECT_GT(large.packets, 120'000U);
  std::printf("allocations per message of 40 pieces: %.1f, of 400: %.1f\n", small.per_message(),
              large.per_message());
  // What a message needs (its bytes, its plan) does not depend on its size, but for the places of
  // its pieces, which are taken in runs that double: 3 for ten times as many, and a page for them.
  EXPECT_NEAR(large.per_message(), small.per_message() + 4, 0.5);
  EXPECT_LE(large.per_message(), 80);
}

// The application takes two, for the bytes and for the list of variants; the receiver takes places
// for 40 pieces in five runs, and both ends the rest.
TEST(Allocation, PlainMessagesNeedFew) {
  TwoHosts hosts;
  hosts.plain = true;
  hosts.run(30s, 40);
  const Cost cost = cost_of(hosts, 30s, 40);
  // The first one finds no link yet, and the last one is under way.
  EXPECT_GE(hosts.answered + 2, hosts.messages);
  std::printf("allocations per plain message: %.1f\n", cost.per_message());
  EXPECT_LE(cost.per_message(), 2 + 5 + 4 + 2);
}

// Whose symbols cover several of them, because nothing can be asked for again in time.
TEST(Allocation, SmallMessagesInWindowsNeedFew) {
  TwoHosts hosts;
  hosts.plain = true;
  hosts.how = {.deadline = 32ms, .policy = "coded"};
  hosts.lose_each = 51;
  hosts.run(10s, 3, 5ms);
  const std::uint64_t answered = hosts.answered;
  const Cost cost = cost_of(hosts, 10s, 3, 5ms);
  std::printf("allocations per small message: %.1f, packets %.2f, delivered %llu of %llu\n",
              cost.per_message(),
              static_cast<double>(cost.packets) / static_cast<double>(cost.messages),
              static_cast<unsigned long long>(hosts.answered - answered),
              static_cast<unsigned long long>(cost.messages));
  EXPECT_GE(hosts.answered - answered, cost.messages * 99 / 100);
  EXPECT_LE(cost.per_message(), 2 + 1 + 4 + 2);
}

TEST(Allocation, LossesNeedNonePerPacket) {
  TwoHosts hosts;
  hosts.lose_each = 50;
  hosts.run(30s, 400);
  const Cost small = cost_of(hosts, 30s, 40);
  const Cost large = cost_of(hosts, 30s, 400);
  EXPECT_GT(large.packets, 120'000U);
  std::printf("allocations per message of 40 pieces: %.1f, of 400: %.1f\n", small.per_message(),
              large.per_message());
  // The list of pieces to be sent again may grow a few times per message.
  EXPECT_LE(large.per_message(), small.per_message() + 8);
}

// A roadside unit has hundreds of peers. What rounds leave behind does not grow with their number.
TEST(Memory, APeerOverTwoLinksTakesLessThan75KiB) {
  for (const std::size_t pieces : {std::size_t{0}, std::size_t{4}, std::size_t{195}}) {
    TwoHosts hosts;
    hosts.run(30s, pieces);
    // Whatever is incomplete is complete by then, or forgotten.
    hosts.run(5s);
    const std::int64_t kib = hosts.heap_of_road() / 1024;
    std::printf("after messages of %zu pieces: %lld KiB\n", pieces, static_cast<long long>(kib));
    EXPECT_GT(kib, 0);
    EXPECT_LT(kib, 75);
  }
}

}  // namespace
}  // namespace interneuron::allocation_test
