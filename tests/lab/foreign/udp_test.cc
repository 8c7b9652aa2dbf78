// Plain UDP: as fast as it gets, and nothing is repaired.
#include "lab/foreign/transports.h"

#include <gtest/gtest.h>

#include "path.h"

namespace interneuron::foreign::udp_test {
namespace {

constexpr Duration kOneWay = 20ms;

TEST(Udp, AMessageAloneTakesItsTimeOnTheLink) {
  Path path(fifo(20, 300ms), kOneWay, std::make_unique<UdpSink>());
  MessageSource& source = path.add(std::make_unique<UdpSource>(1, LinkId{0}, address_of(99)));
  source.send({}, {3, 147'200});
  path.run_until(1s);
  ASSERT_EQ(path.arrivals.size(), 1U);
  EXPECT_EQ(path.arrivals[0].number, 3U);
  EXPECT_NEAR(to_ms(path.arrivals[0].at), 20 + 100 * 1500 * 8 / 20e3, 0.1);
}

TEST(Udp, AMessageOfWhichSomethingIsLostIsLost) {
  Path path(fifo(20, 300ms), kOneWay, std::make_unique<UdpSink>());
  MessageSource& source = path.add(std::make_unique<UdpSource>(1, LinkId{0}, address_of(99)));
  int count = 0;
  path.loses = [&count](const auto&) { return ++count == 5; };
  source.send({}, {0, 14'720});
  source.send({}, {1, 14'720});
  path.run_until(1s);
  ASSERT_EQ(path.arrivals.size(), 1U);
  EXPECT_EQ(path.arrivals[0].number, 1U);
}

TEST(Udp, AtTwiceTheRateHalfOfItIsLost) {
  Path path(fifo(20, 300ms), kOneWay, std::make_unique<UdpSink>());
  MessageSource& source = path.add(std::make_unique<UdpSource>(1, LinkId{0}, address_of(99)));
  // Messages of one datagram, so that each packet that is carried counts.
  for (std::uint32_t i = 0; i < 33'333; ++i) {
    path.at(i * 300us, [&source, &path, i] { source.send(path.now(), {i, 1472}); });
  }
  path.run_until(11s);
  EXPECT_NEAR(static_cast<double>(path.arrivals.size()), 33'333 / 2.0, 33'333 * 0.02);
}

}  // namespace
}  // namespace interneuron::foreign::udp_test
