// How large pieces are where paths carry datagrams of different sizes.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "sender_support.h"

namespace interneuron::flow::sender_sizes_test {
namespace {

constexpr std::size_t kNarrow = 1232;

std::size_t datagram(const Sender::Piece& piece) {
  return piece.fragment.chunk + kPieceOverheadBytes;
}

TEST(SenderSizes, APieceFitsEveryPathThatMayRepairIt) {
  Paths p;
  p.sender.resize(at(0s), kB, kNarrow);
  p.send(at(0s), at(200ms), 10, {kA});
  TimePoint now = at(0s);
  const auto pieces = p.drain(kA, now);
  ASSERT_GT(pieces.size(), 10U);
  for (const auto& piece : pieces) EXPECT_LE(datagram(piece), kNarrow);
  // All of them are lost, and A does not come back.
  p.sender.pull(now, kA);
  EXPECT_EQ(p.drain(kB, now).size(), pieces.size());
}

TEST(SenderSizes, APathThatIsDownOrMayNotRepairHasNoSay) {
  Paths p;
  p.sender.resize(at(0s), kB, kNarrow);
  p.sender.send(at(0s), {.deadline = kFar, .lifetime = 1s}, Bytes(10'000), {kA}, PathSet());
  EXPECT_EQ(datagram(*p.sender.poll(at(0s), kA)), kDatagram);
  p.set(kB, 10ms, 100, false);
  p.send(at(0s), at(1s), 10, {kA});
  EXPECT_EQ(datagram(*p.sender.poll(at(10ms), kA)), kDatagram);

  Paths without_repairs(false);
  without_repairs.sender.resize(at(0s), kB, kNarrow);
  without_repairs.send(at(0s), kFar, 10, {kA});
  EXPECT_EQ(datagram(*without_repairs.sender.poll(at(0s), kA)), kDatagram);
}

TEST(SenderSizes, APathThatCarriesFarLessHasASayOnlyInAPlan) {
  Paths p;
  p.sender.resize(at(0s), kB, 576);
  p.send(at(0s), kFar, 10, {kA});
  EXPECT_EQ(datagram(*p.sender.poll(at(0s), kA)), kDatagram);
  p.send(at(0s), at(1s), 10, {kA, kB});
  EXPECT_EQ(datagram(*p.sender.poll(at(0s), kB)), 576U);
}

TEST(SenderSizes, WhatWasCutForALargerSizeLeavesOverTheOthers) {
  Paths p;
  p.sender.send(at(0s), {.deadline = at(200ms), .lifetime = 1s}, Bytes(10 * kChunk), {kA});
  ASSERT_TRUE(p.sender.poll(at(0s), kA));
  p.sender.resize(at(0s), kA, kNarrow);
  EXPECT_FALSE(p.sender.poll(at(50ms), kA));
  TimePoint now = at(0s);
  EXPECT_EQ(p.drain(kB, now).size(), 9U);
}

TEST(SenderSizes, APathThatGrewKeepsWhatItHas) {
  Paths p;
  p.sender.resize(at(0s), kA, kNarrow);
  p.send(at(0s), at(200ms), 2, {kA});
  p.sender.resize(at(0s), kA, kDatagram);
  TimePoint now = at(0s);
  for (const auto& piece : p.drain(kA, now)) EXPECT_EQ(datagram(piece), kNarrow);
  p.send(now, now + 200ms, 2, {kA});
  for (const auto& piece : p.drain(kA, now)) EXPECT_EQ(datagram(piece), kDatagram);
}

RC_GTEST_PROP(SenderSizes, NothingLeavesAPathThatDoesNotCarryIt, ()) {
  Paths p;
  TimePoint now = at(0s);
  std::map<LinkId, std::size_t> sizes{{kA, kDatagram}, {kB, kDatagram}};
  std::map<LinkId, std::set<std::uint64_t>> arrived;
  for (int step = 0; step < 60; ++step, now += 3ms) {
    const LinkId link = *rc::gen::element(kA, kB);
    switch (*rc::gen::inRange(0, 4)) {
      case 0:
        p.send(now, now + 50ms, *rc::gen::inRange<std::size_t>(1, 20), {link});
        break;
      case 1:
        sizes[link] = *rc::gen::inRange<std::size_t>(300, 1401);
        p.sender.resize(now, link, sizes[link]);
        break;
      case 2:
        if (*rc::gen::arbitrary<bool>()) p.sender.pull(now, link);
        p.set(link, 10ms);
        break;
      default:
        if (!arrived[link].empty()) p.sender.report(now, report_of(link, arrived[link]));
        p.sender.handle_timeout(now);
    }
    for (const LinkId from : {kA, kB}) {
      while (const auto piece = p.sender.poll(now, from)) {
        RC_ASSERT(piece->bytes.size() + kPieceOverheadBytes <= sizes[from]);
        if (*rc::gen::inRange(0, 3) > 0) arrived[from].insert(piece->number);
      }
    }
  }
}

}  // namespace
}  // namespace interneuron::flow::sender_sizes_test
