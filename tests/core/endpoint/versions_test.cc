// Packets that this version does not use: those of types that are not used count as arrived, those
// of other versions are told of, and neither changes who is served.
#include <gtest/gtest.h>

#include "core/code/field.h"
#include "core/code/window.h"
#include "core/flow/partial.h"
#include "core/wire/packet.h"
#include "core/wire/plain_header.h"
#include "core/wire/source.h"
#include "pair.h"

namespace interneuron::versions_test {
namespace {

constexpr SessionId kVehicle{1};

struct Written {
  std::array<std::byte, kMaxDatagramBytes> buffer{};
  std::size_t size = 0;
  ByteView bytes() const { return std::span(buffer).first(size); }
};

Written packet(int type, SessionId session, std::uint64_t number) {
  Written out;
  const wire::PacketHeader header{static_cast<wire::PacketType>(type), kFast, wire::kClearEpoch,
                                  session, number};
  out.size = wire::write_probe(out.buffer, header, 200);
  return out;
}

// Gives the roadside unit a datagram on its first link; returns how its counters have changed.
LinkCounters fed(Pair& pair, ByteView bytes, std::size_t from = 0) {
  Endpoint& road = pair.pipe.at(pair.road);
  const LinkCounters before = road.link_counters(kFast);
  road.handle_datagram(pair.pipe.local(pair.road), {kFast, address_of(from), bytes});
  const LinkCounters after = road.link_counters(kFast);
  LinkCounters change;
  change.received_packets = after.received_packets - before.received_packets;
  change.malformed_packets = after.malformed_packets - before.malformed_packets;
  change.refused_packets = after.refused_packets - before.refused_packets;
  change.duplicate_packets = after.duplicate_packets - before.duplicate_packets;
  change.other_packets = after.other_packets - before.other_packets;
  change.other_version_packets = after.other_version_packets - before.other_version_packets;
  return change;
}

TEST(UnusedTypes, CountAsArrivedAndAreAcknowledged) {
  Pair pair;
  std::uint64_t number = 10'000'000;
  for (int type = 5; type < 16; ++type) {
    if (wire::is_used(static_cast<wire::PacketType>(type))) continue;
    const Written other = packet(type, kVehicle, ++number);
    EXPECT_EQ(fed(pair, other.bytes()).other_packets, 1U) << type;
    EXPECT_EQ(fed(pair, other.bytes()).duplicate_packets, 1U) << type;
  }
  std::vector<Pipe::Captured> sent;
  pair.pipe.capture = &sent;
  pair.pipe.flush(pair.road);
  std::uint64_t acknowledged = 0;
  for (const Pipe::Captured& c : sent) {
    const auto parsed = wire::parse(c.bytes);
    if (!parsed) continue;
    for (const wire::LinkReport& report : parsed->feedback.reports) {
      if (report.link == kFast) acknowledged = std::max(acknowledged, report.largest);
    }
  }
  EXPECT_EQ(acknowledged, number);
}

TEST(UnusedTypes, MakeNoPeerAndRestartNone) {
  Pair pair;
  EXPECT_EQ(fed(pair, packet(5, SessionId{77}, 1).bytes(), 9).refused_packets, 1U);
  EXPECT_EQ(pair.pipe.at(pair.road).peers().size(), 1U);
  // From the address of a peer that the vehicle connected to, with another session.
  Endpoint& vehicle = pair.pipe.at(pair.vehicle);
  vehicle.handle_datagram(pair.pipe.local(pair.vehicle),
                          {kFast, address_of(pair.road), packet(5, SessionId{77}, 1).bytes()});
  pair.pipe.flush(pair.vehicle);
  EXPECT_EQ(pair.restarted, 0);
}

// It may be the first of its message that comes.
TEST(RepairSymbols, AreKeptUntilTheirMessageIsComplete) {
  Pair pair;
  const wire::FragmentHeader fragment{MessageId{5}, 3, 100, 250, 1000};
  Written out;
  const wire::PacketHeader header{wire::PacketType::kData, kFast, wire::kClearEpoch, kVehicle,
                                  10'000'000};
  out.size = wire::write_data(out.buffer, header, fragment, Bytes(100));
  EXPECT_EQ(fed(pair, out.bytes()).received_packets, 1U);
  EXPECT_GE(pair.pipe.at(pair.road).reassembly_bytes(), fragment.chunk);
  EXPECT_LE(pair.pipe.at(pair.road).reassembly_bytes(), flow::Partial::first_growth(fragment));
  // Pieces 0 and 2, and it stands for piece 1.
  for (const std::uint16_t index : {std::uint16_t{0}, std::uint16_t{2}}) {
    wire::FragmentHeader piece = fragment;
    piece.index = index;
    const wire::PacketHeader next{wire::PacketType::kData, kFast, wire::kClearEpoch, kVehicle,
                                  10'000'001ULL + index};
    out.size = wire::write_data(out.buffer, next, piece, Bytes(piece.bytes()));
    EXPECT_EQ(fed(pair, out.bytes()).received_packets, 1U);
  }
  EXPECT_EQ(pair.pipe.at(pair.road).reassembly_bytes(), 0U);
}

// The windows repair a message whose only packet is lost.
TEST(Windows, BringBackMessagesThatAreDeliveredAndToldOf) {
  Pair pair;
  wire::PlainHeader plain{.id = 1,
                          .deadline_us = 1'000'000,
                          .t0 = PeerTime{pair.pipe.local(pair.vehicle).time_since_epoch()}};
  Bytes message(wire::kPlainHeaderBytes);
  wire::write_plain_header(std::span(message).first<wire::kPlainHeaderBytes>(), plain);
  message.resize(message.size() + 100, std::byte{42});
  const wire::FragmentHeader fragment{
      MessageId{100'000},       0, 1347, static_cast<std::uint32_t>(message.size()), 1'000'000,
      wire::MessageKind::kPlain};
  const wire::SourceHeader head = wire::source_header(fragment);
  Bytes source(head.begin(), head.end());
  source.insert(source.end(), message.begin(), message.end());
  wire::WindowHeader window;
  window.messages.push_back({fragment.message, 1});
  Bytes symbol(source.size());
  window.for_each([&](std::size_t column, MessageId, std::uint8_t) {
    code::add_multiple(symbol, source, code::coefficient(window.row, column));
  });
  std::vector<Bytes> delivered;
  pair.pipe.on_event = [&delivered](std::size_t, Event& e) {
    if (auto* m = std::get_if<Message>(&e)) delivered.push_back(std::move(m->bytes));
  };
  std::vector<Pipe::Captured> sent;
  pair.pipe.capture = &sent;
  Written out;
  const wire::PacketHeader header{wire::PacketType::kWindow, kFast, wire::kClearEpoch, kVehicle,
                                  10'000'000};
  out.size = wire::write_window(out.buffer, header, window, symbol);
  EXPECT_EQ(fed(pair, out.bytes()).received_packets, 1U);
  EXPECT_EQ(fed(pair, out.bytes()).duplicate_packets, 1U);
  pair.pipe.flush(pair.road);
  pair.pipe.run(20ms);
  EXPECT_EQ(delivered, (std::vector<Bytes>{Bytes(100, std::byte{42})}));
  int told = 0;
  for (const Pipe::Captured& c : sent) {
    const auto parsed = wire::parse(c.bytes);
    if (!parsed || c.from != pair.road || parsed->header.type != wire::PacketType::kFeedback) {
      continue;
    }
    EXPECT_EQ(parsed->feedback.features, wire::kDecodesWindows);
    for (const auto& complete : parsed->feedback.complete) {
      told += complete.message == fragment.message ? 1 : 0;
    }
  }
  EXPECT_GE(told, 1);
}

TEST(OtherVersions, AreCountedAndToldOfOnceInTenSeconds) {
  Pair pair;
  std::vector<OtherVersion> told;
  pair.pipe.on_event = [&told](std::size_t, Event& e) {
    if (auto* other = std::get_if<OtherVersion>(&e)) told.push_back(*other);
  };
  Bytes version_1(60);
  version_1[0] = version_1[1] = version_1[7] = version_1[15] = std::byte{1};
  Bytes version_4(60);
  version_4[0] = std::byte{0x45};
  version_4[7] = version_4[15] = std::byte{1};
  for (int i = 0; i < 100; ++i) {
    EXPECT_EQ(fed(pair, version_1, 9).other_version_packets, 1U);
    EXPECT_EQ(fed(pair, version_4, 9).other_version_packets, 1U);
  }
  pair.pipe.flush(pair.road);
  ASSERT_EQ(told.size(), 1U);
  EXPECT_EQ(told[0].version, 1);
  EXPECT_EQ(told[0].link, kFast);
  EXPECT_EQ(told[0].from, address_of(9));
  pair.pipe.run(10s);
  fed(pair, version_4, 9);
  pair.pipe.flush(pair.road);
  ASSERT_EQ(told.size(), 2U);
  EXPECT_EQ(told[1].version, 4);
  EXPECT_EQ(pair.pipe.at(pair.road).peers().size(), 1U);
}

TEST(OtherVersions, GarbageIsNone) {
  Pair pair;
  int told = 0;
  pair.pipe.on_event = [&told](std::size_t, Event& e) {
    told += std::holds_alternative<OtherVersion>(e) ? 1 : 0;
  };
  for (int byte = 0; byte < 256; ++byte) {
    EXPECT_EQ(fed(pair, Bytes(60, std::byte(byte)), 9).malformed_packets, 1U) << byte;
  }
  pair.pipe.flush(pair.road);
  EXPECT_EQ(told, 0);
}

TEST(Receipts, ReachTheSenderOfAMessage) {
  Pair pair;
  std::vector<Pipe::Captured> sent;
  pair.pipe.capture = &sent;
  pair.rounds(1);
  std::size_t complete = 0;
  for (const Pipe::Captured& c : sent) {
    const auto parsed = wire::parse(c.bytes);
    if (parsed && c.from == pair.road) complete += parsed->feedback.complete.size();
  }
  EXPECT_GE(complete, 1U);
}

}  // namespace
}  // namespace interneuron::versions_test
