// What the receiving side makes of a packet's stamp and size and of a plain message's header.
#include <gtest/gtest.h>

#include "core/flow/arrivals.h"
#include "core/flow/reassembler.h"
#include "core/wire/plain_header.h"

namespace interneuron::flow::arrival_test {
namespace {

using namespace std::chrono_literals;

constexpr LinkId kLink{3};

TimePoint at(Duration d) { return TimePoint{d}; }

TEST(PathReceiver, ReportsTheNewestAndTheLargestDelay) {
  PathReceiver r(kLink);
  EXPECT_FALSE(r.report(at(1s)).has_delays);
  // Sent every 10 ms by a clock 5 s behind ours, in a queue of 3, 8 and 2 ms.
  const auto arrive = [&r](Duration sent, Duration queue) {
    r.note_delay(at(sent + 5s + 20ms + queue), wire::send_stamp(at(sent)));
  };
  arrive(0ms, 3ms);
  arrive(10ms, 8ms);
  arrive(20ms, 2ms);
  wire::LinkReport report = r.report(at(6s));
  EXPECT_TRUE(report.has_delays);
  EXPECT_EQ(report.newest_delay_us, 5'022'000U);
  EXPECT_EQ(report.largest_delay_us, 5'028'000U);
  r.reported();
  EXPECT_EQ(r.report(at(6s)).largest_delay_us, 5'028'000U);
  arrive(30ms, 1ms);
  report = r.report(at(6s));
  EXPECT_EQ(report.newest_delay_us, 5'021'000U);
  EXPECT_EQ(report.largest_delay_us, 5'021'000U);
}

TEST(PathReceiver, DelaysWrapWithTheStamps) {
  PathReceiver r(kLink);
  // The peer's clock is ahead, so that delays are just below 2^32 and just above 0.
  r.note_delay(at(1s), wire::send_stamp(at(1s + 1ms)));
  r.note_delay(at(1s), wire::send_stamp(at(1s - 1ms)));
  EXPECT_EQ(r.report(at(1s)).largest_delay_us, 1'000U);
  r.note_delay(at(1s), wire::send_stamp(at(1s + 2ms)));
  EXPECT_EQ(r.report(at(1s)).largest_delay_us, 1'000U);
  EXPECT_EQ(r.report(at(1s)).newest_delay_us, UINT32_MAX - 1'999U);
}

TEST(PathReceiver, CountsTheBytesThatItAccepts) {
  PathReceiver r(kLink);
  r.accept(at(0s), 1, PathReceiver::Role::kData, 1428);
  r.accept(at(0s), 1, PathReceiver::Role::kData, 1428);
  r.accept(at(0s), 2, PathReceiver::Role::kNone, 100);
  EXPECT_EQ(r.report(at(0s)).received_bytes, 1528U);
}

TEST(Reassembler, APlainMessageExpiresByItsSendersClock) {
  const ClockBounds clocks{SessionId{1}, SessionId{2}, 1h + 20ms};
  wire::PlainHeader h{.deadline_us = 100'000, .t0 = PeerTime{5s}};
  Bytes bytes(wire::kPlainHeaderBytes);
  wire::write_plain_header(std::span(bytes).first<wire::kPlainHeaderBytes>(), h);
  wire::Data first;
  first.fragment = {MessageId{1}, 0,       wire::kPlainHeaderBytes,
                    250,          130'000, wire::MessageKind::kPlain};
  first.bytes = bytes;
  Reassembler r;
  r.add(at(1h + 5s + 10ms), first, clocks);
  EXPECT_EQ(r.next_timeout(), at(1h + 5s + 20ms + 100ms + 2ms));
}

}  // namespace
}  // namespace interneuron::flow::arrival_test
