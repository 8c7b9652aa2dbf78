#include "core/base/source_limit.h"

#include <gtest/gtest.h>

namespace interneuron::source_limit_test {
namespace {

using namespace std::chrono_literals;

constexpr Duration kInterval = 500us;
constexpr int kBurst = 2048;

// The bytes of a sockaddr_in, of 10.0.x.y.
Address ipv4(unsigned host, unsigned port = 40000) {
  Address a{.size = 16};
  a.raw[2] = static_cast<std::byte>(port >> 8);
  a.raw[3] = static_cast<std::byte>(port & 0xff);
  a.raw[4] = std::byte{10};
  a.raw[5] = static_cast<std::byte>(host >> 16 & 0xff);
  a.raw[6] = static_cast<std::byte>(host >> 8 & 0xff);
  a.raw[7] = static_cast<std::byte>(host & 0xff);
  return a;
}

// The bytes of a sockaddr_in6: `first` begins the address, `last` ends it.
Address ipv6(unsigned first, unsigned last) {
  Address a{.size = 28};
  a.raw[8] = static_cast<std::byte>(first >> 8);
  a.raw[9] = static_cast<std::byte>(first & 0xff);
  a.raw[23] = static_cast<std::byte>(last);
  return a;
}

class Limiting : public testing::Test {
 protected:
  int take(const Address& from, int requests) {
    int answers = 0;
    for (int i = 0; i < requests; ++i) answers += limit_.allow(now_, from) ? 1 : 0;
    return answers;
  }
  SourceLimit limit_{kInterval, kBurst};
  TimePoint now_{1h};
};

TEST_F(Limiting, ABurstAndThenTheRate) {
  EXPECT_EQ(take(ipv4(1), 3 * kBurst), kBurst);
  int answers = 0;
  for (int i = 0; i < 10'000; ++i) {
    now_ += 100us;
    answers += take(ipv4(1), 1);
  }
  EXPECT_EQ(answers, 1s / kInterval);
}

TEST_F(Limiting, APauseRefillsTheBucketAndNoMore) {
  take(ipv4(1), kBurst);
  now_ += 10 * kInterval;
  EXPECT_EQ(take(ipv4(1), 100), 10);
  now_ += 24h;
  EXPECT_EQ(take(ipv4(1), 3 * kBurst), kBurst);
}

TEST_F(Limiting, PortsOfOneHostShareABucketAndHostsDoNot) {
  for (unsigned port = 1; port <= unsigned{kBurst}; ++port) {
    ASSERT_TRUE(limit_.allow(now_, ipv4(1, port)));
  }
  EXPECT_FALSE(limit_.allow(now_, ipv4(1, 9)));
  EXPECT_TRUE(limit_.allow(now_, ipv4(2, 9)));
  EXPECT_EQ(limit_.sources(), 2U);
}

TEST_F(Limiting, AnIpv6PrefixIsOneSourceAndALinkLocalHostIsOneByItself) {
  EXPECT_EQ(take(ipv6(0x2001, 1), kBurst), kBurst);
  EXPECT_FALSE(limit_.allow(now_, ipv6(0x2001, 2)));
  EXPECT_TRUE(limit_.allow(now_, ipv6(0x2002, 1)));
  EXPECT_EQ(take(ipv6(0xfe80, 1), kBurst), kBurst);
  EXPECT_FALSE(limit_.allow(now_, ipv6(0xfe80, 1)));
  EXPECT_TRUE(limit_.allow(now_, ipv6(0xfe80, 2)));
}

TEST_F(Limiting, AFloodOfForgedSourcesNeitherLocksOutAnybodyNorFreesWhoHasHadEnough) {
  const Address greedy = ipv4(1);
  const Address honest = ipv4(2);
  EXPECT_EQ(take(greedy, kBurst), kBurst);
  int of_greedy = 0;
  for (unsigned i = 0; i < 50'000; ++i) {
    now_ += 20us;
    EXPECT_TRUE(limit_.allow(now_, ipv4(1000 + i)));
    of_greedy += take(greedy, 1);
    if (i % 50 == 0) {
      EXPECT_TRUE(limit_.allow(now_, honest));
    }
  }
  EXPECT_EQ(limit_.sources(), SourceLimit::kMaxSources);
  EXPECT_EQ(of_greedy, 1s / kInterval);
}

TEST(SenderPort, IsReadFromIpAddressesAlone) {
  EXPECT_EQ(sender_port(ipv4(1, 862)), 862);
  Address other;
  other.raw[2] = std::byte{3};
  other.raw[3] = std::byte{0x5e};
  other.size = 4;
  EXPECT_EQ(sender_port(other), 0);
}

}  // namespace
}  // namespace interneuron::source_limit_test
