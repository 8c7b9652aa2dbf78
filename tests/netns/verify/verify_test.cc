// What `testbed verify` expects of a schedule, and how it reads the tools.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "netns/verify/readings.h"
#include "netns/verify/schedule.h"
#include "verify_support.h"

namespace interneuron::netns::verify::verify_test {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::seconds;

// --- schedule

TEST(VerifySchedule, HoldsASampleForItsStep) {
  const Schedule s = made(milliseconds(30),
                          [](std::int64_t step) { return 20.0 + 2.0 * static_cast<double>(step); });
  EXPECT_EQ(s.one_way(milliseconds(9)), milliseconds(10));
  EXPECT_EQ(s.one_way(milliseconds(10)), milliseconds(11));
  EXPECT_EQ(s.one_way(seconds(9)), milliseconds(12));
  EXPECT_TRUE(s.covers(Duration{}, milliseconds(29)));
  EXPECT_FALSE(s.covers(Duration{}, milliseconds(30)));
}

TEST(VerifySchedule, PacketsNeverOvertakeEachOther) {
  // 100 ms, from 1 s on 20 ms: what is sent after arrives no sooner than what was sent before.
  const Schedule s = made(
      seconds(2), [](std::int64_t step) { return step < 100 ? 100.0 : 20.0; }, 0, 1e6);
  const std::vector<Sent> traffic{{milliseconds(999), 100, false},
                                  {milliseconds(1001), 100, false}};
  const Course course(s, Direction::kUp, traffic);
  EXPECT_NEAR(to_ms(course.arrival(0)), 1049, 0.001);
  EXPECT_EQ(course.arrival(1), course.arrival(0));
  EXPECT_NEAR(to_ms(course.arrival(milliseconds(1100), 84)), 1110, 0.001);
  const std::vector<Sent> lost{{milliseconds(999), 100, true}, {milliseconds(1001), 100, false}};
  EXPECT_NEAR(to_ms(Course(s, Direction::kUp, lost).arrival(1)), 1011, 0.001);
}

TEST(VerifySchedule, PacketsWaitForTheBottleneck) {
  const Schedule s = constant(20, 0, 1);  // 1000 bytes take 8 ms
  const std::vector<Sent> traffic{{seconds(1), 1000, false}, {seconds(1), 1000, false}};
  const Course course(s, Direction::kDown, traffic);
  EXPECT_NEAR(to_ms(course.arrival(0) - seconds(1)), 18, 0.001);
  EXPECT_NEAR(to_ms(course.arrival(1) - seconds(1)), 26, 0.001);
}

TEST(VerifySchedule, BitsLessWhatIsLost) {
  EXPECT_NEAR(constant(20, 0.1, 10).bits_between(Direction::kUp, seconds(1), milliseconds(3005)),
              10e6 * 2.005 * 0.9, 1);
  EXPECT_EQ(constant(20).sent_by(milliseconds(1015)), milliseconds(1005));
}

// --- readings

TEST(VerifyReadings, Ping) {
  const PingLog log = parse_ping(
      "PING 10.77.0.1 (10.77.0.1) from 10.77.1.2 : 56(84) bytes of data.\n"
      "[1795276741.316347] 64 bytes from 10.77.0.1: icmp_seq=1 ttl=63 time=22.1 ms\n"
      "[1795276741.328708] 64 bytes from 10.77.0.1: icmp_seq=2 ttl=63 time=173 ms\n"
      "[1795276741.328708] 64 bytes from 10.77.0.1: icmp_seq=2 ttl=63 time=174 ms (DUP!)\n"
      "[1795276741.32] 64 bytes from\n"
      "From 10.77.1.1 icmp_seq=3 Destination Host Unreachable\n"
      "\n--- 10.77.0.1 ping statistics ---\n"
      "44 packets transmitted, 2 received, 95% packet loss, time 28ms\n");
  ASSERT_EQ(log.answered.size(), 2U);
  EXPECT_EQ(log.answered[0].sequence, 1U);
  EXPECT_EQ(log.answered[0].round_trip, microseconds(22100));
  EXPECT_EQ(log.answered[0].sent, seconds(1795276741) + microseconds(316347 - 22100));
  EXPECT_EQ(log.answered[1].round_trip, milliseconds(173));
  EXPECT_EQ(log.transmitted, 44U);
}

void put(std::string& out, std::uint64_t value, int bytes, bool network) {
  for (int i = 0; i < bytes; ++i) {
    out += static_cast<char>(value >> 8U * static_cast<unsigned>(network ? bytes - 1 - i : i));
  }
}

std::string capture_header(std::uint32_t magic = 0xa1b2c3d4) {
  std::string out;
  put(out, magic, 4, false);
  out.append(12, '\0');
  put(out, 64, 4, false);
  put(out, 1, 4, false);
  return out;
}

std::string record(std::uint32_t number, std::uint8_t protocol = 17) {
  std::string frame(12, '\0');
  put(frame, 0x0800, 2, true);
  put(frame, 0x4500, 2, true);
  put(frame, 128, 2, true);
  frame.append(5, '\0');
  frame += static_cast<char>(protocol);
  frame.append(10, '\0');
  put(frame, 40000, 2, true);
  put(frame, 46000, 2, true);
  put(frame, 108, 2, true);
  put(frame, 0, 2, true);
  put(frame, 13306, 4, true);
  put(frame, 500'000, 4, true);
  put(frame, number, 4, true);
  std::string out;
  put(out, 1795276722, 4, false);
  put(out, 54253, 4, false);
  put(out, frame.size(), 4, false);
  put(out, 142, 4, false);
  return out + frame;
}

TEST(VerifyReadings, TimesThatNoPingHasAreSkipped) {
  const std::string rest = " 64 bytes from 10.77.0.1: icmp_seq=1 ttl=63 time=";
  EXPECT_EQ(parse_ping("[1795276741.316347]" + rest + "22.1 ms\n").answered.size(), 1U);
  for (const std::string& line :
       {"[9223372036854775807.316347]" + rest + "22.1 ms\n", "[-9.316347]" + rest + "22.1 ms\n",
        "[1795276741.-16347]" + rest + "22.1 ms\n", "[1795276741.316347]" + rest + "1e300 ms\n",
        "[1795276741.316347]" + rest + "-1 ms\n", "[1795276741.316347]" + rest + "nan ms\n"}) {
    EXPECT_TRUE(parse_ping(line).answered.empty()) << line;
  }
}

TEST(VerifyReadings, Capture) {
  const std::string text = capture_header() + record(1) + record(2, 6) + record(3);
  const auto records = parse_capture(text);
  ASSERT_TRUE(records);
  ASSERT_EQ(records->size(), 2U);
  EXPECT_EQ(records->at(1).number, 3U);
  EXPECT_EQ(records->at(1).from_port, 40000);
  EXPECT_EQ(records->at(1).to_port, 46000);
  EXPECT_EQ(records->at(1).ip_bytes, 128U);
  EXPECT_EQ(records->at(1).seen, seconds(1795276722) + microseconds(54253));
  EXPECT_EQ(records->at(1).stamp, seconds(13306) + milliseconds(500));
  const auto nano = parse_capture(capture_header(0xa1b23c4d) + record(1));
  EXPECT_EQ(nano->at(0).seen, seconds(1795276722) + Duration{54253});
}

TEST(VerifyReadings, ACaptureCutOffAnywhere) {
  const std::string text = capture_header() + record(1) + record(2);
  for (std::size_t length = 0; length < text.size(); ++length) {
    const auto records = parse_capture(text.substr(0, length));
    EXPECT_EQ(records.has_value(), length >= 24);
    EXPECT_LE(records ? records->size() : 0, 1U);
  }
  std::mt19937_64 rng(kSeed);  // and with any byte changed, it reads nothing that is not there
  for (int i = 0; i < 2000; ++i) {
    std::string bad = text;
    bad[rng() % bad.size()] = static_cast<char>(rng());
    parse_capture(bad);
  }
}

TEST(VerifyReadings, CaptureDrops) {
  EXPECT_EQ(parse_capture_drops("12 packets captured\n24 packets received by filter\n"
                                "5 packets dropped by kernel\n"),
            5U);
  EXPECT_EQ(parse_capture_drops("1 packet dropped by kernel\n"), 1U);
  EXPECT_EQ(parse_capture_drops("tcpdump: no such device\n"), std::nullopt);
}

// --- flows

Duration sent_at(std::uint32_t number) { return milliseconds(100 + number); }

std::vector<Datagram> numbers(const std::vector<std::uint32_t>& which, Duration delay) {
  std::vector<Datagram> out;
  for (const std::uint32_t n : which) out.push_back(datagram(n, sent_at(n) + delay, sent_at(n)));
  return out;
}

TEST(VerifyFlow, LossOrderAndDuplicates) {
  std::vector<Datagram> received = numbers({1, 3, 2, 2, 5}, milliseconds(10));
  received.push_back(datagram(4, milliseconds(200), milliseconds(999)));  // a stamp never sent
  received.push_back(datagram(0xffffffff, milliseconds(200), {}));
  const Flow flow = match(numbers({1, 2, 3, 4, 5, 6}, {}), received, SentBy::kCapture);
  ASSERT_EQ(flow.packets.size(), 6U);
  EXPECT_EQ(flow.reordered, 1U);
  EXPECT_EQ(flow.duplicates, 1U);
  EXPECT_EQ(flow.foreign, 2U);
  EXPECT_TRUE(flow.packets[1].arrived);
  EXPECT_FALSE(flow.packets[3].arrived);
  EXPECT_FALSE(flow.packets[5].arrived);
  EXPECT_EQ(trim(flow, sent_at(2), sent_at(5)).packets.size(), 3U);
}

TEST(VerifyFlow, BehindAQdiscTheStampsTell) {
  // The sender's capture sees what netem let through, when it did.
  const auto seen = numbers({2, 5}, milliseconds(10));
  const Flow flow = match(seen, seen, SentBy::kStamp);
  ASSERT_EQ(flow.packets.size(), 4U);  // from 2 on; before it nothing is known
  EXPECT_EQ(flow.packets[0].sent, sent_at(2));
  EXPECT_EQ(flow.packets[1].sent, sent_at(3));
  EXPECT_EQ(flow.packets[2].sent, sent_at(4));
  EXPECT_FALSE(flow.packets[2].arrived);
  EXPECT_EQ(*flow.packets[3].arrived - flow.packets[3].sent, milliseconds(10));
}

TEST(VerifyFlow, NothingSeen) {
  EXPECT_TRUE(match({}, {}, SentBy::kCapture).packets.empty());
  EXPECT_TRUE(match({}, {}, SentBy::kStamp).packets.empty());
  EXPECT_EQ(match({}, numbers({3}, {}), SentBy::kCapture).foreign, 1U);
}

// Every packet moves the chain on; every `other_every`-th is not of the flow.
Flow bursty(const emu::GilbertElliott& chain, std::size_t other_every) {
  std::mt19937_64 rng(kSeed);
  std::uniform_real_distribution<double> uniform;
  Flow flow;
  bool bad = false;
  for (std::size_t i = 1; i < 2'000'000; ++i) {
    const bool lost = uniform(rng) < (bad ? chain.loss_in_bad : chain.loss_in_good);
    if (uniform(rng) < (bad ? chain.r : chain.p)) bad = !bad;
    if (other_every != 0 && i % other_every == 0) continue;
    Flow::Packet packet{milliseconds(i), 128, std::nullopt};
    if (!lost) packet.arrived = packet.sent;
    flow.packets.push_back(packet);
  }
  return flow;
}

TEST(VerifyFlow, BurstsAreAsLongAsExpected) {
  const Schedule schedule = constant(20);
  for (const emu::GilbertElliott chain :
       {emu::GilbertElliott{0.005, 0.2, 0, 1}, emu::GilbertElliott{0.01, 0.3, 0.01, 0.6}}) {
    for (const std::size_t other_every : {0U, 15U}) {
      const Bursts seen = bursts(bursty(chain, other_every), schedule, Direction::kUp);
      const double others = other_every == 0 ? 0 : 1.0 / static_cast<double>(other_every - 1);
      EXPECT_GT(seen.count, 5000U);
      EXPECT_NEAR(seen.mean / expected_burst(chain, 0, others), 1, 0.02) << other_every;
    }
  }
  EXPECT_DOUBLE_EQ(expected_burst({0.005, 0.2, 0, 1}, 0, 0), 5);
}

TEST(VerifyFlow, BurstsMakeLossVary) {
  EXPECT_NEAR(chance_of_loss(0.05, std::nullopt, 47'500), 0.001, 1e-6);
  const emu::GilbertElliott chain{0.005, 0.2, 0, 1};
  constexpr std::size_t kPackets = 20'000;
  const Flow flow = bursty(chain, 0);
  double squares = 0;
  int parts = 0;
  for (std::size_t at = 0; at + kPackets <= flow.packets.size(); at += kPackets, ++parts) {
    double lost = 0;
    for (std::size_t i = at; i < at + kPackets; ++i) lost += flow.packets[i].arrived ? 0 : 1;
    squares += std::pow(lost / kPackets - 0.005 / 0.205, 2);
  }
  EXPECT_NEAR(std::sqrt(squares / parts) / chance_of_loss(0.0244, chain, kPackets), 1, 0.25);
}

}  // namespace
}  // namespace interneuron::netns::verify::verify_test
