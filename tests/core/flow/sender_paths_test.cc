// What becomes of messages on a path that is suspected of having fallen silent.
#include <gtest/gtest.h>

#include "sender_support.h"

namespace interneuron::flow::sender_paths_test {
namespace {

// A plain message of so many pieces on path A; rounds stay where they are.
void send(Paths& p, TimePoint deadline, std::size_t pieces) {
  p.sender.send(at(0s), {.deadline = deadline, .lifetime = deadline - at(0s)},
                Bytes(pieces * kChunk), {kA}, kEveryPath, wire::MessageKind::kPlain);
}

// As long as a path is suspected, its view says so, too.
void doubt(Paths& p, TimePoint now, LinkId link) {
  PathView v = view(10ms);
  v.suspect = true;
  p.sender.set_path(link, v);
  p.sender.doubt(now, link);
}

TEST(SenderDoubt, SendsWhatIsUnderWayOverTheOther) {
  Paths p;
  send(p, at(100ms), 5);
  ASSERT_TRUE(p.sender.poll(at(0s), kA));
  doubt(p, at(20ms), kA);
  TimePoint now = at(20ms);
  EXPECT_EQ(p.drain(kB, now).size(), 5U);
  EXPECT_FALSE(p.sender.poll(now, kA));
}

TEST(SenderDoubt, LeavesWhatTheOtherCannotBringInTime) {
  Paths p;
  p.set(kB, 200ms);
  send(p, at(100ms), 5);
  doubt(p, at(20ms), kA);
  TimePoint now = at(20ms);
  EXPECT_TRUE(p.drain(kB, now).empty());
  EXPECT_EQ(p.drain(kA, now).size(), 5U);
}

TEST(SenderDoubt, AnAcknowledgementSavesTheSecondCopy) {
  Paths p;
  send(p, at(100ms), 5);
  TimePoint now = at(0s);
  std::set<std::uint64_t> numbers;
  for (const auto& piece : p.drain(kA, now)) numbers.insert(piece.number);
  doubt(p, at(20ms), kA);
  p.sender.report(at(21ms), report_of(kA, numbers));
  now = at(21ms);
  EXPECT_TRUE(p.drain(kB, now).empty());
}

TEST(SenderDoubt, RoundsStayOnTheLinksOfTheirPlan) {
  Paths p;
  p.send(at(0s), at(100ms), 5, {kA});
  doubt(p, at(20ms), kA);
  TimePoint now = at(20ms);
  EXPECT_TRUE(p.drain(kB, now).empty());
  EXPECT_EQ(p.drain(kA, now).size(), 5U);
}

TEST(SenderDoubt, RepairsUseItWhereNoOtherPathIsUp) {
  Paths p;
  p.set(kB, 10ms, 100, false);
  send(p, at(200ms), 1);
  ASSERT_TRUE(p.sender.poll(at(0s), kA));
  doubt(p, at(20ms), kA);
  p.sender.handle_timeout(at(60ms));
  EXPECT_TRUE(p.sender.poll(at(60ms), kA));
}

}  // namespace
}  // namespace interneuron::flow::sender_paths_test
