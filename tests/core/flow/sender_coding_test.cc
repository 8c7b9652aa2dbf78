// Repair symbols and shares of a Sender.
#include <gtest/gtest.h>

#include <map>

#include "sender_support.h"

namespace interneuron::flow::sender_coding_test {
namespace {

// Two paths of 100 Mbit/s and 39 ms one way, of which 1 % of the packets are lost.
struct Far : Paths {
  Far() {
    for (const LinkId link : {kA, kB}) far(link);
  }
  void far(LinkId link, double loss = 0.01, Duration one_way = 39ms) {
    PathView v = view(one_way);
    v.losses = {loss, 1, -1};
    sender.set_path(link, v);
  }
  MessageId coded(std::size_t pieces, Duration deadline,
                  std::uint8_t importance = kUsualImportance) {
    return sender.send(at(0s),
                       {.deadline = at(deadline), .lifetime = deadline, .importance = importance},
                       Bytes(pieces * kChunk), {kA}, kEveryPath, wire::MessageKind::kPlain,
                       {.symbols = kEveryPath});
  }
  // How many pieces and symbols leave each path by then.
  std::map<LinkId, std::pair<int, int>> leave(Duration until) {
    std::map<LinkId, std::pair<int, int>> out;
    for (; now <= at(until); now += 100us) {
      for (const LinkId link : {kA, kB}) {
        while (const auto piece = sender.poll(now, link)) {
          auto& [pieces, symbols] = out[link];
          ++(piece->fragment.is_repair() ? symbols : pieces);
          numbers[link].push_back({piece->number, piece->fragment.index});
        }
      }
    }
    return out;
  }
  // The peer reports that all of a path has arrived but these indices.
  void report(Duration when, LinkId link, const std::set<std::uint16_t>& lost) {
    std::set<std::uint64_t> arrived;
    for (const auto& [number, index] : numbers[link]) {
      if (!lost.contains(index)) arrived.insert(number);
    }
    sender.report(at(when), report_of(link, arrived), 78ms);
  }
  TimePoint now = at(0s);
  std::map<LinkId, std::vector<std::pair<std::uint64_t, std::uint16_t>>> numbers;
};

TEST(SenderCoding, SymbolsFollowOverTheOtherPathWhereNothingCouldBeAskedForAgain) {
  Far p;
  p.coded(98, 100ms);
  const auto left = p.leave(20ms);
  EXPECT_EQ(left.at(kA), (std::pair{98, 0}));
  EXPECT_EQ(left.at(kB).first, 0);
  EXPECT_GE(left.at(kB).second, 4);
  EXPECT_LE(left.at(kB).second, 8);
}

TEST(SenderCoding, NoneAreSentWhereThereIsTimeToAskAgain) {
  Far p;
  p.coded(98, 300ms);
  EXPECT_EQ(p.leave(20ms).count(kB), 0U);
}

TEST(SenderCoding, NoneAreSentWithoutLossOrInTheWayOfOthers) {
  Far clean;
  clean.far(kA, 0);
  clean.coded(98, 100ms);
  EXPECT_EQ(clean.leave(20ms).count(kB), 0U);
  Far loaded;
  for (const LinkId link : {kA, kB}) {
    PathView v = view(39ms);
    v.losses = {0.01, 1, -1};
    v.loaded = true;
    loaded.sender.set_path(link, v);
  }
  loaded.coded(98, 100ms);
  // Another message waits for that path, and one for the message's own.
  for (const LinkId link : {kA, kB}) loaded.send(at(0s), at(300ms), 400, {link});
  EXPECT_EQ(loaded.leave(20ms)[kB].second, 0);
}

TEST(SenderCoding, WhatMattersMoreGetsMore) {
  const auto symbols = [](std::uint8_t importance) {
    Far p;
    p.coded(98, 100ms, importance);
    return p.leave(20ms)[kB].second;
  };
  EXPECT_LT(symbols(10), symbols(128));
  EXPECT_LE(symbols(128), symbols(255));
}

TEST(SenderCoding, WhatSymbolsStandForIsNotSentAgain) {
  Far p;
  p.coded(98, 130ms);
  const auto first = p.leave(20ms);
  ASSERT_GE(first.at(kB).second, 3);
  // Two pieces are lost: the symbols under way suffice. Then their loss is weighed anew.
  p.report(100ms, kA, {60, 61});
  p.now = at(100ms);
  const auto then = p.leave(101ms);
  for (const auto& [link, left] : then) EXPECT_EQ(left.first, 0);
}

TEST(SenderCoding, WhatIsLostBeyondTheSymbolsIsSentAgain) {
  Far p;
  p.coded(98, 160ms);
  p.leave(20ms);
  std::set<std::uint16_t> lost;
  for (std::uint16_t i = 0; i < 20; ++i) lost.insert(i);
  p.report(90ms, kA, lost);
  p.now = at(90ms);
  int again = 0;
  for (const auto& [link, left] : p.leave(110ms)) again += left.first + left.second;
  EXPECT_GE(again, 10);
}

TEST(SenderCoding, SymbolsAcknowledgedEndTheMessageAsPiecesDo) {
  Far p;
  p.coded(98, 100ms);
  const int symbols = p.leave(20ms).at(kB).second;
  std::set<std::uint16_t> lost;
  for (int i = 0; i < symbols; ++i) lost.insert(static_cast<std::uint16_t>(50 + i));
  EXPECT_GT(p.sender.bytes(), 0U);
  p.report(60ms, kA, lost);
  EXPECT_GT(p.sender.bytes(), 0U);
  p.report(60ms, kB, {});
  EXPECT_EQ(p.sender.bytes(), 0U);
}

TEST(SenderCoding, TheEndIsCoveredWhereItsLossWouldBeKnownByATimeoutAlone) {
  // Ten pieces leave within 1.1 ms. The loss of the first ones is told at 83 ms, that of the last
  // ones at 151 ms, after the timeout of 150 ms; the copy takes 39 ms.
  for (const auto& [deadline, symbols] : {std::pair{150ms, true}, std::pair{220ms, false}}) {
    Far p;
    for (const LinkId link : {kA, kB}) {
      PathView v = view(39ms);
      v.losses = {0.01, 1, -1};
      v.probe_timeout = 150ms;
      p.sender.set_path(link, v);
    }
    p.coded(10, deadline);
    EXPECT_EQ(p.leave(20ms)[kB].second > 0, symbols) << to_ms(deadline);
  }
}

TEST(SenderCoding, SymbolsLeaveAtOnceWhereTheyCouldNotWait) {
  Far p;
  // All of it has left after 10.6 ms; what leaves then is there after 41 ms more at the soonest.
  p.coded(98, 50ms);
  const auto left = p.leave(1ms);
  EXPECT_GT(left.at(kB).second, 0);
}

// A path that fails is when symbols are worth most.
TEST(SenderCoding, WhatMovesToAnotherPathHasSymbolsThere) {
  const std::map<const char*, void (*)(Sender&)> ways{
      {"pulled", [](Sender& s) { s.pull(at(3ms), kA); }},
      {"suspected", [](Sender& s) { s.doubt(at(3ms), kA); }},
      {"removed", [](Sender& s) { s.remove_path(at(3ms), kA); }}};
  for (const auto& [name, fails] : ways) {
    Far p;
    p.coded(98, 100ms);
    const auto before = p.leave(3ms);
    ASSERT_LT(before.at(kA).first, 98) << name;
    fails(p.sender);
    std::pair<int, int> over_b;
    for (TimePoint now = at(3ms); now <= at(30ms); now += 100us) {
      while (const auto piece = p.sender.poll(now, kB)) {
        ++(piece->fragment.is_repair() ? over_b.second : over_b.first);
      }
    }
    EXPECT_EQ(over_b.first, 98) << name;
    EXPECT_GE(over_b.second, 3) << name;
    EXPECT_LE(over_b.second, 10) << name;
  }
}

TEST(SenderCoding, HugeMessagesHaveSymbolsInEachBlock) {
  Far p;
  p.coded(1000, 200ms);
  std::map<std::size_t, int> blocks;
  p.leave(120ms);
  const code::Blocks division(1000);
  for (const auto& [number, index] : p.numbers[kB]) ++blocks[division.block_of(index)];
  EXPECT_EQ(blocks.size(), 5U);
}

// --- shares

TEST(SenderStriping, PathsDivideAMessageByWhatTheyBringInTime) {
  Paths p;
  p.set(kA, 10ms, 60);
  p.set(kB, 10ms, 30);
  p.sender.send(at(0s), {.deadline = at(60ms), .lifetime = 60ms}, Bytes(300 * kChunk), {kA, kB},
                kEveryPath, wire::MessageKind::kRound, {.divided = true});
  TimePoint now = at(0s);
  std::set<std::uint16_t> seen;
  const auto over_a = p.drain(kA, now);
  now = at(0s);
  const auto over_b = p.drain(kB, now);
  for (const auto& piece : over_a) seen.insert(piece.fragment.index);
  for (const auto& piece : over_b) EXPECT_TRUE(seen.insert(piece.fragment.index).second);
  EXPECT_EQ(seen.size(), 300U);
  EXPECT_NEAR(static_cast<double>(over_a.size()), 200, 5);
}

TEST(SenderStriping, ASlowPathGetsNothingWhereItWouldOnlyAddRisk) {
  Paths p;
  p.set(kA, 10ms, 100);
  p.set(kB, 50ms, 2);
  p.sender.send(at(0s), {.deadline = at(100ms), .lifetime = 100ms}, Bytes(98 * kChunk), {kA, kB},
                kEveryPath, wire::MessageKind::kRound, {.divided = true});
  EXPECT_FALSE(p.sender.poll(at(0s), kB));
  TimePoint now = at(0s);
  EXPECT_EQ(p.drain(kA, now).size(), 98U);
}

// Two paths, 60 and 30 Mbit/s, that a message is divided between.
struct Divided : Paths {
  MessageId message = send_divided();
  std::map<LinkId, std::set<std::uint16_t>> left;
  std::size_t twice = 0;

  MessageId send_divided() {
    set(kA, 10ms, 60);
    set(kB, 10ms, 30);
    return sender.send(at(0s), {.deadline = at(80ms), .lifetime = 80ms}, Bytes(300 * kChunk),
                       {kA, kB}, kEveryPath, wire::MessageKind::kPlain, {.divided = true});
  }
  // The rate of a path that carries all it can.
  void fall(LinkId link, double mbit) {
    PathView v = view(10ms, mbit);
    v.loaded = true;
    v.soon = v.rate;
    sender.set_path(link, v);
  }
  void run(Duration from, Duration until) {
    for (TimePoint now = at(from); now <= at(until); now += 100us) {
      for (const LinkId link : {kA, kB}) {
        while (const auto piece = sender.poll(now, link)) {
          const bool again =
              left[kA].contains(piece->fragment.index) || left[kB].contains(piece->fragment.index);
          twice += again ? 1 : 0;
          left[link].insert(piece->fragment.index);
        }
      }
    }
  }
};

TEST(SenderStriping, APathThatIsDoneTakesOverWhatAnotherIsTooSlowFor) {
  Divided p;
  p.fall(kA, 10);
  p.run(0ms, 79ms);
  // kA has 200 pieces at first, of which it brings 70 in time.
  EXPECT_EQ(p.left[kA].size() + p.left[kB].size(), 300U);
  EXPECT_GT(p.left[kB].size(), 200U);
  EXPECT_EQ(p.twice, 0U);
}

TEST(SenderStriping, APathThatIsDoneAsksToSendWhereItWouldTakeSomethingOver) {
  Divided p;
  TimePoint now = at(0s);
  p.drain(kB, now);
  EXPECT_FALSE(p.sender.next_send(kB)) << "kA brings the rest as soon";
  p.fall(kA, 10);
  EXPECT_TRUE(p.sender.next_send(kB));
}

TEST(SenderStriping, ASuspectPathGetsAShareWhereTheOthersAreNotInTime) {
  for (const double mbit : {60.0, 10.0}) {
    Paths p;
    p.set(kA, 10ms, mbit);
    PathView v = view(10ms, 60);
    v.suspect = true;
    p.sender.set_path(kB, v);
    p.sender.send(at(0s), {.deadline = at(80ms), .lifetime = 80ms}, Bytes(200 * kChunk), {kA, kB},
                  kEveryPath, wire::MessageKind::kPlain, {.divided = true});
    EXPECT_EQ(p.sender.poll(at(0s), kB).has_value(), mbit < 60) << mbit;
  }
}

TEST(SenderStriping, ASuspectPathTakesNothingOver) {
  Divided p;
  p.fall(kA, 10);
  PathView v = view(10ms, 30);
  v.suspect = true;
  p.sender.set_path(kB, v);
  p.run(0ms, 79ms);
  EXPECT_LE(p.left[kB].size(), 100U);
}

TEST(SenderStriping, WhatPathsMayBringTogetherIsNotGivenUp) {
  Divided p;
  p.fall(kA, 10);
  p.fall(kB, 30);
  p.run(0ms, 20ms);
  EXPECT_TRUE(p.sender.next_send(kA));
  EXPECT_FALSE(p.sender.poll_given_up());
}

TEST(SenderStriping, WhatTheyCannotBringTogetherIsGivenUp) {
  Divided p;
  p.run(0ms, 5ms);
  p.fall(kA, 1);
  p.fall(kB, 1);
  p.run(5ms, 20ms);
  EXPECT_EQ(p.sender.poll_given_up(), p.message);
  EXPECT_FALSE(p.sender.next_send(kA) || p.sender.next_send(kB));
}

}  // namespace
}  // namespace interneuron::flow::sender_coding_test
