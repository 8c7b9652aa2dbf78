#include "host/io/address.h"

#include <arpa/inet.h>
#include <gtest/gtest.h>

#include <cstring>

namespace interneuron::address_test {
namespace {

TEST(Address, TextRoundTrip) {
  for (const char* text : {"10.0.0.2:47000", "127.0.0.1:0", "255.255.255.255:65535", "[::1]:47000",
                           "[2001:db8::7]:1", "[fe80::1%lo]:9"}) {
    const auto address = parse_address(text);
    ASSERT_TRUE(address) << text;
    EXPECT_EQ(to_string(*address), text);
  }
  EXPECT_EQ(port_of(*parse_address("10.0.0.2:47000")), 47000);
  EXPECT_EQ(port_of(*parse_address("[::1]:65535")), 65535);
  EXPECT_EQ(parse_address("[fe80::1%1]:9"), parse_address("[fe80::1%lo]:9"));
}

TEST(Address, EveryOtherTextIsRefused) {
  for (const char* text : {"",
                           ":",
                           "10.0.0.2",
                           "10.0.0.2:",
                           ":47000",
                           "10.0.0.2:65536",
                           "10.0.0.2:-1",
                           "10.0.0.2:1x",
                           "10.0.0.2: 1",
                           "10.0.0:1",
                           "host:1",
                           "::1:47000",
                           "[::1]",
                           "[::1]:",
                           "[10.0.0.2]:1",
                           "[::1:1",
                           "::1]:1",
                           "[]:1",
                           "[fe80::1%no-such-nic]:1",
                           "[::g]:1"}) {
    EXPECT_FALSE(parse_address(text)) << text;
  }
  std::string longest(10000, '1');
  longest += ":1";
  EXPECT_FALSE(parse_address(longest));
  EXPECT_EQ(to_string(Address{}), "?");
  EXPECT_EQ(port_of(Address{}), 0);
}

struct Kind {
  const char* host;
  bool loopback, link_local, private_, unspecified;
};

TEST(Address, Kinds) {
  for (const Kind& kind : std::initializer_list<Kind>{
           {"127.0.0.1", true, false, true, false},
           {"127.255.0.9", true, false, true, false},
           {"169.254.3.4", false, true, true, false},
           {"10.255.255.255", false, false, true, false},
           {"11.0.0.0", false, false, false, false},
           {"172.16.0.1", false, false, true, false},
           {"172.31.255.1", false, false, true, false},
           {"172.32.0.1", false, false, false, false},
           {"192.168.8.1", false, false, true, false},
           {"192.169.0.1", false, false, false, false},
           {"100.64.0.1", false, false, false, false},  // shared with a carrier's other customers
           {"8.8.8.8", false, false, false, false},
           {"0.0.0.0", false, false, false, true},
           {"::1", true, false, true, false},
           {"fe80::1", false, true, true, false},
           {"fd00::1", false, false, true, false},
           {"2001:db8::1", false, false, false, false},
           {"::", false, false, false, true},
       }) {
    const auto address = make_address(kind.host, 1);
    ASSERT_TRUE(address) << kind.host;
    EXPECT_EQ(is_loopback(*address), kind.loopback) << kind.host;
    EXPECT_EQ(is_link_local(*address), kind.link_local) << kind.host;
    EXPECT_EQ(is_private(*address), kind.private_) << kind.host;
    EXPECT_EQ(is_unspecified(*address), kind.unspecified) << kind.host;
  }
  EXPECT_FALSE(is_private(Address{}) || is_loopback(Address{}) || is_unspecified(Address{}));
}

TEST(Address, PaddingDoesNotMakePeersDiffer) {
  sockaddr_in ipv4{};
  ipv4.sin_family = AF_INET;
  ipv4.sin_port = htons(5);
  ipv4.sin_addr.s_addr = htonl(0x0a000002);
  std::memset(ipv4.sin_zero, 0x5a, sizeof ipv4.sin_zero);
  const Address address = io::from_sockaddr(reinterpret_cast<const sockaddr*>(&ipv4), sizeof ipv4);
  EXPECT_EQ(address, *parse_address("10.0.0.2:5"));

  sockaddr_in6 ipv6{};
  ipv6.sin6_family = AF_INET6;
  ipv6.sin6_port = htons(5);
  ipv6.sin6_flowinfo = 77;
  ipv6.sin6_addr = in6addr_loopback;
  EXPECT_EQ(io::from_sockaddr(reinterpret_cast<const sockaddr*>(&ipv6), sizeof ipv6),
            *parse_address("[::1]:5"));
  EXPECT_EQ(io::from_sockaddr(reinterpret_cast<const sockaddr*>(&ipv6), 8), Address{});
}

}  // namespace
}  // namespace interneuron::address_test
