// What a Sender does for messages that are likely to be late.
#include <gtest/gtest.h>

#include <map>
#include <set>

#include "sender_support.h"

namespace interneuron::flow::sender_rescue_test {
namespace {

// 100 Mbit/s and 10 ms over kA; kB stands by.
struct Standby : Paths {
  MessageId send(std::size_t pieces, Duration deadline, const PathSet& rescue,
                 wire::MessageKind kind = wire::MessageKind::kRound) {
    return sender.send(at(0s), {.deadline = at(deadline), .lifetime = deadline},
                       Bytes(pieces * kChunk), {kA}, {}, kind, {.rescue = rescue});
  }
  static PathSet over_b() { return PathSet::of(std::vector{kB}); }
  // Lets time go by until then, with what is due.
  int run(Duration until) {
    int over_b = 0;
    for (; now <= at(until); now += 500us) {
      sender.handle_timeout(now);
      while (const auto piece = sender.poll(now, kA)) sent.push_back(piece->number);
      while (has_b && sender.poll(now, kB)) ++over_b;
    }
    return over_b;
  }
  void all_arrived(Duration when) {
    sender.report(at(when), report_of(kA, {sent.begin(), sent.end()}), 20ms);
  }
  void remove_b(Duration when) {
    sender.remove_path(at(when), kB);
    has_b = false;
  }
  std::vector<std::uint64_t> sent;
  TimePoint now = at(0s);
  bool has_b = true;
};

TEST(SenderRescue, WhatIsMissingGoesOverTheOtherPathAtTheLastMoment) {
  Standby p;
  p.send(50, 80ms, Standby::over_b());
  // 50 pieces take 5.7 ms over kB and 10 ms on the way: they have to leave after 62 ms.
  EXPECT_EQ(p.run(60ms), 0);
  EXPECT_EQ(p.run(79ms), 50);
}

TEST(SenderRescue, APathRepeatsNothingThatItCarriesItself) {
  Paths p;
  for (const LinkId link : {kA, kB}) p.set(link, 10ms, 60);
  p.sender.send(at(0s), {.deadline = at(100ms), .lifetime = 100ms}, Bytes(200 * kChunk), {kA, kB},
                kEveryPath, wire::MessageKind::kPlain, {.divided = true, .rescue = kEveryPath});
  std::map<LinkId, std::multiset<std::uint16_t>> left;
  const auto run = [&](Duration from, Duration until) {
    for (TimePoint now = at(from); now <= at(until); now += 100us) {
      for (const LinkId link : {kA, kB}) {
        while (const auto piece = p.sender.poll(now, link)) {
          left[link].insert(piece->fragment.index);
        }
      }
    }
  };
  run(0ms, 10ms);
  p.sender.doubt(at(10ms), kB);
  run(10ms, 60ms);
  for (const std::uint16_t index : left[kA]) EXPECT_EQ(left[kA].count(index), 1U) << index;
  EXPECT_EQ(left[kA].size(), 200U);
}

TEST(SenderRescue, NothingWhereItHasArrived) {
  Standby p;
  p.send(50, 80ms, Standby::over_b());
  EXPECT_EQ(p.run(30ms), 0);
  p.all_arrived(30ms);
  EXPECT_EQ(p.run(100ms), 0);
}

TEST(SenderRescue, OnlyWhatIsMissing) {
  Standby p;
  p.send(50, 80ms, Standby::over_b());
  EXPECT_EQ(p.run(30ms), 0);
  std::set<std::uint64_t> some(p.sent.begin(), p.sent.begin() + 30);
  p.sender.report(at(30ms), report_of(kA, some), 20ms);
  EXPECT_EQ(p.run(79ms), 20);
}

TEST(SenderRescue, ASmallerVariantWhereTheRestHasNoTime) {
  Standby p;
  // 600 pieces take 68 ms over kB: too long from the beginning.
  const MessageId large = p.send(600, 75ms, Standby::over_b());
  p.sender.add_alternative(at(0s), large, Bytes(40 * kChunk), Standby::over_b());
  // The 40 pieces of the smaller one take 5 ms at a rate one deviation, a tenth, below the
  // believed.
  EXPECT_EQ(p.run(57ms), 0);
  EXPECT_EQ(p.run(74ms), 40);
}

TEST(SenderRescue, MayCompleteWhatHasNotLeftOverItsOwnPath) {
  Standby p;
  // At 100 kbit/s a piece leaves kA every 100 ms.
  p.set(kA, 10ms, 0.1);
  const MessageId id = p.send(50, 80ms, Standby::over_b());
  EXPECT_LT(p.run(20ms), 50);
  EXPECT_TRUE(p.sender.is_surely_incomplete(id));
  p.run(79ms);
  EXPECT_LT(p.sent.size(), 50U);
  EXPECT_FALSE(p.sender.is_surely_incomplete(id));
}

// A plain message that would be late if its path faded is helped out at once by the one that stands
// by, which repeats nothing.
TEST(SenderRescue, ATightPlainMessageIsShared) {
  Standby p;
  p.send(300, 80ms, Standby::over_b(), wire::MessageKind::kPlain);
  const int over_b = p.run(30ms);
  EXPECT_GT(over_b, 100);
  EXPECT_EQ(static_cast<std::size_t>(over_b) + p.sent.size(), 300U);
}

TEST(SenderRescue, AMessageWithTimeToSpareIsNot) {
  Standby p;
  p.send(50, 80ms, Standby::over_b(), wire::MessageKind::kPlain);
  EXPECT_EQ(p.run(30ms), 0);
}

TEST(SenderRescue, NorIsThatOfARound) {
  Standby p;
  p.send(300, 80ms, Standby::over_b());
  EXPECT_EQ(p.run(30ms), 0);
}

TEST(SenderRescue, NotOverAPathThatIsSuspected) {
  Standby p;
  p.send(50, 80ms, Standby::over_b());
  PathView v = view(10ms);
  v.suspect = true;
  p.sender.set_path(kB, v);
  EXPECT_EQ(p.run(100ms), 0);
}

// What is missing does not go over its own path instead: all leaves as if nothing were to rescue
// it.
TEST(SenderRescue, NothingByAPathThatIsGone) {
  Standby gone, none;
  for (Standby* p : {&gone, &none}) {
    p->send(50, 80ms, p == &gone ? Standby::over_b() : PathSet{});
    p->run(0ms);
    p->remove_b(1ms);
    p->run(30ms);
    p->sender.report(at(30ms), report_of(kA, {p->sent.begin(), p->sent.begin() + 30}), 20ms);
    p->run(79ms);
    EXPECT_EQ(p->sender.next_timeout(), at(80ms));
  }
  EXPECT_EQ(gone.sent, none.sent);
  EXPECT_EQ(gone.sender.resent(kA), none.sender.resent(kA));
}

}  // namespace
}  // namespace interneuron::flow::sender_rescue_test
