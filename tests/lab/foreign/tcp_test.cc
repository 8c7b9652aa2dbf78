// TCP and MPTCP through a bottleneck: how much of it they use, how they share it, and that messages
// arrive whole and in order whatever is lost.
#include "lab/foreign/transports.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "lab/emu/random.h"
#include "lab/foreign/congestion.h"
#include "path.h"

namespace interneuron::foreign::tcp_test {
namespace {

constexpr Duration kOneWay = 20ms;

template <class Control>
double alone(const emu::CellParams& cell, sim::Ecn ecn = sim::Ecn::kNotEct) {
  Path path(cell, kOneWay, std::make_unique<TcpSink>());
  path.add(tcp<Control>(1, {LinkId{0}}, ecn)).send({}, {0, kUnlimitedBytes});
  path.run_until(20s);
  return share_of_link(path, 1, 20s);
}

TEST(Tcp, CubicAloneFillsALink) {
  for (const double mbit : {5.0, 20.0, 60.0}) {
    EXPECT_GT(alone<Cubic>(fifo(mbit, 100ms)), 0.95) << mbit;
  }
}

TEST(Tcp, BbrLikeAloneFillsALinkAndKeepsItsQueueShort) {
  for (const double mbit : {5.0, 20.0, 60.0}) {
    Path path(fifo(mbit, 300ms), kOneWay, std::make_unique<TcpSink>());
    path.add(tcp<BbrLike>(1)).send({}, {0, kUnlimitedBytes});
    path.run_until(20s);
    EXPECT_GT(share_of_link(path, 1, 20s), 0.9) << mbit;
    EXPECT_LT(path.cell().queue_time().quantile(0.9), 60ms) << mbit;
  }
}

TEST(Tcp, CubicAnswersMarksAndLosesNothing) {
  auto cell = fifo(20, 300ms);
  cell.codel.emplace();
  Path path(cell, kOneWay, std::make_unique<TcpSink>());
  auto source = tcp<Cubic>(1, {LinkId{0}}, sim::Ecn::kEct0);
  const TcpSource& kept = *source;
  path.add(std::move(source)).send({}, {0, kUnlimitedBytes});
  path.run_until(20s);
  EXPECT_GT(path.cell().stats().marked, 10U);
  EXPECT_EQ(path.cell().stats().codel_drops, 0U);
  EXPECT_EQ(kept.subflow(0).timeouts(), 0U);
  EXPECT_GT(share_of_link(path, 1, 20s), 0.85);
  EXPECT_LT(path.cell().queue_time().quantile(0.5), 40ms);
}

TEST(Tcp, TwoCubicFlowsShareALink) {
  Path path(fifo(20, 100ms), kOneWay, std::make_unique<TcpSink>());
  path.add(tcp<Cubic>(1)).send({}, {0, kUnlimitedBytes});
  MessageSource& second = path.add(tcp<Cubic>(2));
  path.at(3s, [&] { second.send(path.now(), {0, kUnlimitedBytes}); });
  path.run_until(60s);
  const double a = share_of_link(path, 1, 60s);
  const double b = share_of_link(path, 2, 57s);
  EXPECT_GT((a + b) * (a + b) / (2 * (a * a + b * b)), 0.9) << a << " " << b;
  EXPECT_GT(a + b, 0.95);
}

TEST(Tcp, EverySecondSegmentIsAcknowledged) {
  Path path(fifo(20, 1s), kOneWay, std::make_unique<TcpSink>());
  path.add(tcp<Cubic>(1)).send({}, {0, std::uint64_t{400} * kMss});
  path.run_until(5s);
  ASSERT_EQ(path.arrivals.size(), 1U);
  EXPECT_GE(path.acks, 200U);
  EXPECT_LE(path.acks, 215U);
}

TEST(Tcp, AMessageAloneTakesItsTimeOnTheLink) {
  Path path(fifo(20, 300ms), kOneWay, std::make_unique<TcpSink>());
  MessageSource& source = path.add(tcp<Cubic>(1));
  // The initial window carries ten segments, so that these are there after one way.
  source.send({}, {7, 10 * kMss});
  path.run_until(1s);
  ASSERT_EQ(path.arrivals.size(), 1U);
  EXPECT_EQ(path.arrivals[0].number, 7U);
  EXPECT_EQ(path.arrivals[0].connection, 1U);
  EXPECT_NEAR(to_ms(path.arrivals[0].at), 20 + 10 * 1500 * 8 / 20e3, 0.1);
}

TEST(Tcp, ALostTailIsSentAgainWithoutARetransmissionTimeout) {
  Path path(fifo(20, 300ms), kOneWay, std::make_unique<TcpSink>());
  auto made = tcp<Cubic>(1);
  const TcpSource& kept = *made;
  MessageSource& source = path.add(std::move(made));
  source.send({}, {0, 5 * kMss});
  path.run_until(1s);
  int count = 0;
  path.loses = [&count](const auto&) { return ++count == 4 || count == 5; };
  source.send(path.now(), {1, 5 * kMss});
  path.run_until(2s);
  ASSERT_EQ(path.arrivals.size(), 2U);
  EXPECT_GT(count, 6);
  EXPECT_EQ(kept.subflow(0).timeouts(), 0U);
  // The second acknowledgement is held back for 40 ms; with a timeout it would take 40 ms longer.
  EXPECT_LT(path.arrivals[1].at, 1s + 260ms);
}

TEST(Tcp, OfWhatWaitsTheNewestIsSentWhileItIsOfUse) {
  Path path(fifo(1, 300ms), kOneWay, std::make_unique<TcpSink>());
  MessageSource& source = path.add(tcp<Cubic>(1));
  // Twice what the link carries; the last one comes when nothing else is there any more.
  for (std::uint32_t i = 0; i < 100; ++i) {
    path.at(i * 100ms, [&source, &path, i] {
      source.send(path.now(), {i, 25'000, path.now() + 1s});
    });
  }
  path.run_until(20s);
  EXPECT_GE(path.arrivals.size(), 45U);
  EXPECT_LE(path.arrivals.size(), 55U);
  EXPECT_EQ(path.arrivals.back().number, 99U);
}

TEST(Tcp, AMessageThatIsExpiredBeforeItWasBegunIsNotSent) {
  Path path(fifo(1, 300ms), kOneWay, std::make_unique<TcpSink>());
  MessageSource& source = path.add(tcp<Cubic>(1));
  source.send({}, {0, 100'000});
  path.at(10ms, [&] { source.send(path.now(), {1, 1000, 100ms}); });
  path.run_until(5s);
  EXPECT_EQ(path.arrivals.size(), 1U);
}

TEST(Tcp, AStallOfOneSubflowDoesNotStopTheOther) {
  Path path(fifo(20, 300ms), kOneWay, std::make_unique<TcpSink>());
  MessageSource& source = path.add(tcp<Cubic>(1, {LinkId{0}, LinkId{1}}));
  path.loses = [&path](const sim::ForeignPacket& p) {
    return p.link == LinkId{0} && path.now() > 1s;
  };
  for (std::uint32_t i = 0; i < 40; ++i) {
    path.at(i * 100ms, [&source, &path, i] { source.send(path.now(), {i, 50'000}); });
  }
  path.run_until(20s);
  ASSERT_GT(path.arrivals.size(), 20U);
  EXPECT_EQ(path.arrivals.back().number, 39U);
  // The first one that was on its way over the lost subflow waits for a timeout, and all behind it.
  EXPECT_LT(path.arrivals.back().at, 6s);
}

RC_GTEST_PROP(TcpProperty, MessagesArriveWholeAndInOrderWhateverIsLost, ()) {
  const auto sizes =
      *rc::gen::container<std::vector<std::uint64_t>>(rc::gen::inRange<std::uint64_t>(1, 60'000));
  const auto loss = *rc::gen::inRange(0, 20) / 100.0;
  const auto seed = *rc::gen::arbitrary<std::uint64_t>();
  const bool two = *rc::gen::arbitrary<bool>();
  const bool rate_based = *rc::gen::arbitrary<bool>();
  emu::RandomStream random(seed);
  Path path(fifo(10, 50ms), kOneWay, std::make_unique<TcpSink>());
  path.loses = [&](const auto&) { return random.chance(loss); };
  const std::vector<LinkId> links =
      two ? std::vector{LinkId{0}, LinkId{1}} : std::vector{LinkId{0}};
  MessageSource& source = path.add(rate_based ? tcp<BbrLike>(1, links) : tcp<Cubic>(1, links));
  for (std::uint32_t i = 0; i < sizes.size(); ++i) {
    path.at(i * 20ms, [&source, &path, &sizes, i] { source.send(path.now(), {i, sizes[i]}); });
  }
  path.run_until(3600s);
  // Messages that were superseded before they were begun are not there.
  std::uint64_t total = 0;
  for (std::size_t i = 0; i < path.arrivals.size(); ++i) {
    total += sizes[path.arrivals[i].number];
    if (i > 0) RC_ASSERT(path.arrivals[i - 1].number < path.arrivals[i].number);
  }
  RC_ASSERT(path.sink->readable_bytes(1) == total);
  RC_ASSERT(sizes.empty() == path.arrivals.empty());
  if (!sizes.empty()) RC_ASSERT(path.arrivals.back().number + 1 == sizes.size());
}

}  // namespace
}  // namespace interneuron::foreign::tcp_test
