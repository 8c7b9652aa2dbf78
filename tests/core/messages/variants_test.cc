// Which variant of a plain message is delivered, and when.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "core/wire/plain_header.h"
#include "door.h"

namespace interneuron::variants_test {
namespace {

// The best variant over kSlow, the other one over kFast.
class Ladder final : public Policy {
 public:
  Ladder(std::string_view name, Merge merge) : name_(name), merge_(merge) {}
  std::string_view name() const override { return name_; }
  Plan plan(const Offer& offer, std::span<const LinkState>, const Guidance&) const override {
    Plan plan;
    plan.sends.push_back({0, kSlow});
    if (offer.variant_bytes.size() > 1) plan.sends.push_back({1, kFast});
    return plan;
  }
  Merge merge(const Arrival& arrival) const override {
    return arrival.variant > arrival.best_planned ? merge_ : Merge::kDeliver;
  }

 private:
  std::string_view name_;
  Merge merge_;
};

EndpointOptions with_ladders() {
  EndpointOptions options = options_of(1, {}, false);
  options.policies.push_back(std::make_shared<Ladder>("ladder", Merge::kHold));
  options.policies.push_back(std::make_shared<Ladder>("first", Merge::kDeliver));
  return options;
}

struct Variant : ::testing::Test {
  Door d{1h, options_of(2), with_ladders()};

  // What is larger than a small message takes so much longer, over either link.
  void delay_large(Duration by) {
    d.pipe.drop = [this](std::size_t, LinkId, ByteView bytes) {
      is_large_ = bytes.size() > 1'000;
      return false;
    };
    d.pipe.jitter = [this, by] { return is_large_ ? by : 0ms; };
    d.pipe.spins_allowed = 3;
  }

  // How long after send() the only message that came was handed over.
  Duration took(const SendResult& sent) {
    EXPECT_EQ(d.came.size(), 1U);
    return d.came.empty() ? Duration{} : d.came[0].at - d.sent[sent.id].at;
  }

 private:
  bool is_large_ = false;
};

TEST_F(Variant, ABetterOneThatIsOnItsWayIsWaitedFor) {
  delay_large(50ms);
  const SendResult sent = d.send({Bytes(9'000), Bytes(900)}, {.policy = "ladder"});
  d.pipe.run(1s);
  EXPECT_NEAR(to_ms(took(sent)), 60, 2);
  EXPECT_EQ(d.came.at(0).what.variant, 0);
  EXPECT_EQ(d.came.at(0).what.bytes.size(), 9'000U);
  EXPECT_EQ(d.fate(sent.id).fate, Fate::kDelivered);
  EXPECT_EQ(d.fate(sent.id).variant, 0);
  EXPECT_EQ(d.pipe.at(d.road).ledger(d.back).held_messages, 0U);
}

TEST_F(Variant, WhereItDoesNotComeTheOtherIsHandedOverJustInTime) {
  delay_large(150ms);
  const SendResult sent = d.send({Bytes(9'000), Bytes(900)}, {.policy = "ladder"});
  d.pipe.run(1s);
  EXPECT_GT(took(sent), 95ms);
  EXPECT_LE(took(sent), 100ms);
  EXPECT_EQ(d.came.at(0).what.variant, 1);
  EXPECT_LE(d.came.at(0).what.age, 100ms);
  EXPECT_EQ(d.fate(sent.id).fate, Fate::kDelivered);
  EXPECT_EQ(d.fate(sent.id).variant, 1);
}

TEST_F(Variant, ThePolicyMayDeliverTheFirstOne) {
  delay_large(50ms);
  const SendResult sent = d.send({Bytes(9'000), Bytes(900)}, {.policy = "first"});
  d.pipe.run(1s);
  EXPECT_LE(took(sent), 7ms);
  EXPECT_EQ(d.fate(sent.id).variant, 1);
}

TEST_F(Variant, WhatWaitsCountsAgainstThePeersLimit) {
  delay_large(150ms);
  const std::size_t most = PeerLimits{}.held_messages;
  for (std::size_t i = 0; i <= most; ++i) {
    ASSERT_TRUE(d.send({Bytes(9'000), Bytes(900)}, {.policy = "ladder"}).accepted());
  }
  d.pipe.run(50ms);
  const PeerLedger ledger = d.pipe.at(d.road).ledger(d.back);
  EXPECT_EQ(ledger.held_messages, most);
  EXPECT_EQ(ledger.held_bytes, most * 900);
  EXPECT_EQ(ledger.struck(PeerLimit::kHeldMessages), 1U);
  EXPECT_EQ(d.came.size(), 1U);
  d.pipe.run(1s);
  EXPECT_EQ(d.came.size(), most + 1);
}

TEST_F(Variant, OneThatWaitsWhereANewerMessageIsDeliveredIsSuperseded) {
  delay_large(50ms);
  SendOptions options{.policy = "ladder", .newest_only = true};
  const SendResult older = d.send({Bytes(9'000), Bytes(900)}, options);
  d.pipe.run(10ms);
  options.policy = "best_link";
  const SendResult newer = d.send({Bytes(100)}, options);
  d.pipe.run(1s);
  EXPECT_EQ(d.came.size(), 1U);
  EXPECT_EQ(d.fate(newer.id).fate, Fate::kDelivered);
  EXPECT_EQ(d.fate(older.id).fate, Fate::kDropped);
  EXPECT_EQ(d.fate(older.id).reason, FateReason::kSuperseded);
}

TEST(VariantClock, WhileTheSendersClockIsNotKnownNothingWaits) {
  Pipe pipe;
  pipe.add_host(with_ladders());
  const PeerId peer = pipe.connect(0, pipe.add_host(options_of(2)));
  std::vector<std::pair<Message, Duration>> came;
  pipe.on_event = [&](std::size_t host, Event& e) {
    if (auto* m = std::get_if<Message>(&e); m != nullptr && host == 1) {
      came.emplace_back(*m, pipe.now());
    }
  };
  pipe.drop = [](std::size_t from, LinkId, ByteView bytes) {
    const auto packet = wire::parse(bytes);
    return from == 0 && packet && packet->header.type == wire::PacketType::kFeedback;
  };
  pipe.run(500ms);
  pipe.extra_from_0[kSlow] = 50ms;
  const Duration sent = pipe.now();
  const SendOptions options{.policy = "ladder"};
  ASSERT_TRUE(pipe.at(0).send(pipe.local(0), peer, {Bytes(9'000), Bytes(900)}, options).accepted());
  pipe.flush(0);
  pipe.run(500ms);
  ASSERT_EQ(came.size(), 1U);
  EXPECT_FALSE(came[0].first.age);
  EXPECT_LE(came[0].second - sent, 7ms);
}

// When each variant of each message is whole at the other end, by the packets that get there.
struct Oracle {
  explicit Oracle(Door& door, std::mt19937_64& random) : d(door) {
    d.pipe.spins_allowed = 3;
    d.pipe.drop = [this, &random](std::size_t from, LinkId, ByteView bytes) {
      piece = from == d.vehicle ? data_of(bytes) : std::nullopt;
      return from == d.vehicle && random() % 50 == 0;
    };
    d.pipe.jitter = [this, &random] {
      const bool is_late = random() % 8 == 0;
      const Duration late{is_late ? static_cast<std::int64_t>(random() % 60'000'000) : 0};
      if (piece) {
        const TimePoint there{d.pipe.now() + 10ms + late};
        auto& first = whole[piece->message].try_emplace(piece->index, there).first->second;
        first = std::min(first, there);
      }
      return late;
    };
  }
  std::optional<wire::FragmentHeader> data_of(ByteView bytes) {
    const auto packet = wire::parse(bytes);
    if (!packet || packet->header.type != wire::PacketType::kData) return std::nullopt;
    const wire::FragmentHeader& f = packet->data.fragment;
    if (f.is_repair()) return std::nullopt;
    const auto header = f.index == 0 ? wire::parse_plain_header(packet->data.bytes) : std::nullopt;
    if (header) variant[f.message] = {header->t0.time_since_epoch(), header->variant};
    count[f.message] = f.count();
    return f;
  }
  // Whether the best variant of the message that the vehicle sent at this instant is there by then.
  bool best_is_whole(Duration sent, TimePoint by) const {
    return std::ranges::any_of(variant, [&](const auto& entry) {
      const auto& [message, what] = entry;
      if (what != std::pair{sent, std::uint8_t{0}} || !whole.contains(message)) return false;
      const auto& pieces = whole.at(message);
      return pieces.size() == count.at(message) &&
             std::ranges::all_of(pieces, [by](const auto& p) { return p.second <= by; });
    });
  }

  Door& d;
  std::optional<wire::FragmentHeader> piece;
  std::map<MessageId, std::map<std::uint16_t, TimePoint>> whole;
  std::map<MessageId, std::uint16_t> count;
  // When it was sent, by the vehicle's clock, which is the network's; and which variant it is.
  std::map<MessageId, std::pair<Duration, std::uint8_t>> variant;
};

// Over links that lose every fiftieth packet and delay every eighth by up to 60 ms.
TEST_F(Variant, TheBestThatIsWholeByTheDeadlineIsDelivered) {
  std::mt19937_64 random(70'021);
  Oracle oracle(d, random);
  for (int i = 0; i < 400; ++i) {
    d.send({Bytes(12'000), Bytes(1'200)}, {.policy = "ladder"});
    d.pipe.run(50ms);
  }
  d.pipe.run(1s);
  int whole = 0;
  int best = 0;
  for (const auto& [id, sent] : d.sent) {
    if (!oracle.best_is_whole(sent.at, TimePoint{sent.at + 100ms})) continue;
    ++whole;
    const MessageFate fate = d.fate(id);
    best += fate.fate == Fate::kDelivered && fate.variant == 0 ? 1 : 0;
  }
  EXPECT_GT(whole, 150);
  EXPECT_GE(best, whole * 99 / 100) << whole;
}

}  // namespace
}  // namespace interneuron::variants_test
