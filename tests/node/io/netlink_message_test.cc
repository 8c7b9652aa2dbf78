// Messages of the kernel's routing netlink, as bytes: what is too short is absent, and nothing
// behind a message is read (the copies that are read have exactly its size, so that
// AddressSanitizer would see it).
#include "node/monitor/netlink_message.h"

#include <gtest/gtest.h>
#include <linux/if.h>
#include <linux/if_addr.h>
#include <linux/if_link.h>
#include <linux/neighbour.h>
#include <linux/rtnetlink.h>

#include <memory>
#include <string_view>

#include "node/monitor/netlink.h"
#include "node/monitor/nic_table.h"

namespace interneuron::io::netlink_message_test {
namespace {

class MessageBuilder {
 public:
  template <class Header>
  MessageBuilder(int type, const Header& header) : message_(nlmsg_alloc_simple(type, 0)) {
    Header copy = header;
    nlmsg_append(message_.get(), &copy, sizeof copy, NLMSG_ALIGNTO);
  }
  MessageBuilder& put(int type, std::string_view bytes) {
    nla_put(message_.get(), type, static_cast<int>(bytes.size()), bytes.data());
    return *this;
  }
  template <class Number>
  MessageBuilder& put_number(int type, Number number) {
    nla_put(message_.get(), type, sizeof number, &number);
    return *this;
  }
  // Without the padding behind the last attribute, which the kernel need not send.
  const nlmsghdr& build(std::size_t cut = 0) {
    const nlmsghdr* whole = nlmsg_hdr(message_.get());
    const std::size_t size = whole->nlmsg_len - cut;
    bytes_ = std::make_unique<char[]>(size);
    std::memcpy(bytes_.get(), whole, size);
    auto* out = reinterpret_cast<nlmsghdr*>(bytes_.get());
    out->nlmsg_len = static_cast<std::uint32_t>(size);
    return *out;
  }

 private:
  netlink::Message message_;
  std::unique_ptr<char[]> bytes_;
};

constexpr int kCard = 7;

ifinfomsg card_header() {
  ifinfomsg header{};
  header.ifi_index = kCard;
  header.ifi_flags = IFF_UP | IFF_RUNNING;
  return header;
}

rtmsg route_header() {
  rtmsg header{};
  header.rtm_family = AF_INET;
  header.rtm_type = RTN_UNICAST;
  return header;
}

TEST(NetlinkMessage, ACardIsTakenWithItsAttributes) {
  MessageBuilder builder(RTM_NEWLINK, card_header());
  builder.put(IFLA_IFNAME, std::string_view("wwan7\0", 6)).put_number(IFLA_MTU, 1430U);
  builder.put_number(IFLA_CARRIER, std::uint8_t{0}).put_number(IFLA_NUM_RX_QUEUES, 4U);
  NicTable table;
  table.apply(builder.build());
  const Nic* nic = table.find(kCard);
  ASSERT_NE(nic, nullptr);
  EXPECT_EQ(nic->name, "wwan7");
  EXPECT_EQ(nic->mtu, 1430U);
  EXPECT_EQ(nic->receive_queues, 4U);
  EXPECT_FALSE(nic->carrier);
}

TEST(NetlinkMessage, ANameWithoutAnEndStopsAtTheAttributes) {
  MessageBuilder builder(RTM_NEWLINK, card_header());
  builder.put_number(IFLA_MTU, 1500U).put(IFLA_IFNAME, "eth0");
  NicTable table;
  table.apply(builder.build());
  ASSERT_NE(table.find(kCard), nullptr);
  EXPECT_EQ(table.find(kCard)->name, "eth0");
}

TEST(NetlinkMessage, AnMtuThatIsTooShortIsNone) {
  MessageBuilder builder(RTM_NEWLINK, card_header());
  // 5 bytes of attribute end 3 bytes before the next multiple of 4, which the message need not
  // hold.
  builder.put(IFLA_IFNAME, std::string_view("eth0\0", 5)).put(IFLA_MTU, "\x05");
  NicTable table;
  table.apply(builder.build(3));
  EXPECT_EQ(table.find(kCard), nullptr);
}

TEST(NetlinkMessage, OtherNumbersThatAreTooShortCountAsAbsent) {
  MessageBuilder builder(RTM_NEWLINK, card_header());
  builder.put(IFLA_IFNAME, std::string_view("eth0\0", 5)).put_number(IFLA_MTU, 1500U);
  builder.put(IFLA_CARRIER, "").put(IFLA_OPERSTATE, "").put(IFLA_NUM_RX_QUEUES, "\x05");
  NicTable table;
  table.apply(builder.build(3));
  ASSERT_NE(table.find(kCard), nullptr);
  // Without a word on the carrier it follows the flags.
  EXPECT_TRUE(table.find(kCard)->carrier);
  EXPECT_EQ(table.find(kCard)->operstate, "unknown");
  EXPECT_EQ(table.find(kCard)->receive_queues, 1U);
}

TEST(NetlinkMessage, AMessageShorterThanItsHeaderSaysNothing) {
  for (const std::uint16_t type : {RTM_NEWLINK, RTM_DELLINK, RTM_NEWADDR, RTM_DELADDR, RTM_NEWROUTE,
                                   RTM_DELROUTE, RTM_NEWNEIGH, RTM_DELNEIGH}) {
    nlmsghdr message{};
    message.nlmsg_len = sizeof message;
    message.nlmsg_type = type;
    NicTable table;
    table.apply(message);
    table.apply_default_route(message);
    EXPECT_TRUE(table.nics().empty());
    EXPECT_FALSE(netlink::card_of(message)) << type;
    EXPECT_FALSE(netlink::neighbour(message)) << type;
    EXPECT_FALSE(netlink::route_answer(message, kCard)) << type;
    EXPECT_FALSE(netlink::is_default_route(message)) << type;
    EXPECT_FALSE(netlink::leads_through(message, kCard)) << type;
  }
}

TEST(NetlinkMessage, ARouteTellsGatewayAndSource) {
  MessageBuilder builder(RTM_NEWROUTE, route_header());
  builder.put_number(RTA_OIF, std::uint32_t{kCard});
  builder.put(RTA_GATEWAY, std::string_view("\x0a\x00\x00\x01", 4));
  builder.put(RTA_PREFSRC, std::string_view("\x0a\x00\x00\x02", 4));
  const nlmsghdr& message = builder.build();
  const auto answer = netlink::route_answer(message, kCard);
  ASSERT_TRUE(answer);
  EXPECT_EQ(to_string(answer->gateway), "10.0.0.1:0");
  EXPECT_EQ(to_string(answer->source), "10.0.0.2:0");
  EXPECT_TRUE(netlink::leads_through(message, kCard));
  EXPECT_FALSE(netlink::route_answer(message, kCard + 1));
}

TEST(NetlinkMessage, AGatewayOfAnotherFamilyIsRead) {
  MessageBuilder builder(RTM_NEWROUTE, route_header());
  builder.put_number(RTA_OIF, std::uint32_t{kCard});
  std::string via(sizeof(rtvia), '\0');
  via += std::string("\xfe\x80\0\0\0\0\0\0\0\0\0\0\0\0\0\1", 16);
  builder.put(RTA_VIA, via);
  const auto answer = netlink::route_answer(builder.build(), kCard);
  ASSERT_TRUE(answer);
  EXPECT_TRUE(is_ipv6(answer->gateway));
}

TEST(NetlinkMessage, AGatewayOfNoFamilyMakesTheRouteUseless) {
  for (const int type : {RTA_GATEWAY, RTA_VIA}) {
    MessageBuilder builder(RTM_NEWROUTE, route_header());
    builder.put_number(RTA_OIF, std::uint32_t{kCard}).put(type, "\x0a");
    const nlmsghdr& message = builder.build(3);
    EXPECT_FALSE(netlink::route_answer(message, kCard)) << type;
    EXPECT_TRUE(netlink::hops_of(message).empty()) << type;
  }
}

TEST(NetlinkMessage, ADefaultRouteOfSeveralHopsLeadsThroughEachThatLives) {
  NicTable table;
  for (const int card : {1, 2, 3}) {
    ifinfomsg header = card_header();
    header.ifi_index = card;
    MessageBuilder builder(RTM_NEWLINK, header);
    builder.put(IFLA_IFNAME, "eth" + std::to_string(card)).put_number(IFLA_MTU, 1500U);
    table.apply(builder.build());
  }
  std::string hops;
  for (const int card : {1, 2}) {
    const nlattr gateway{NLA_HDRLEN + 4, RTA_GATEWAY};
    rtnexthop hop{};
    hop.rtnh_len = sizeof hop + NLA_HDRLEN + 4;
    hop.rtnh_ifindex = card;
    hop.rtnh_flags = card == 2 ? RTNH_F_DEAD : 0;
    hops += std::string_view(reinterpret_cast<const char*>(&hop), sizeof hop);
    hops += std::string_view(reinterpret_cast<const char*>(&gateway), sizeof gateway);
    hops += std::string_view("\x0a\x00\x00\x01", 4);
  }
  MessageBuilder builder(RTM_NEWROUTE, route_header());
  builder.put(RTA_MULTIPATH, hops);
  table.apply_default_route(builder.build());
  EXPECT_TRUE(table.has_default_route(1, false));
  EXPECT_FALSE(table.has_default_route(2, false));
  EXPECT_FALSE(table.has_default_route(3, false));
  ASSERT_EQ(table.find(1)->gateways.size(), 1U);
  EXPECT_EQ(to_string(table.find(1)->gateways.front()), "10.0.0.1:0");
}

TEST(NetlinkMessage, HopsThatDoNotAddUpAreNoRoute) {
  rtnexthop hop{};
  hop.rtnh_ifindex = kCard;
  for (const int length : {0, 7, 8, 9}) {
    hop.rtnh_len = static_cast<std::uint16_t>(length);
    const std::string_view one(reinterpret_cast<const char*>(&hop), sizeof hop);
    MessageBuilder builder(RTM_NEWROUTE, route_header());
    builder.put(RTA_MULTIPATH, std::string(one) + std::string(one));
    const nlmsghdr& message = builder.build();
    // 9 bytes reach into the second hop, which then is too short.
    const bool whole = length == static_cast<int>(sizeof hop);
    EXPECT_EQ(netlink::leads_through(message, kCard), whole) << length;
    EXPECT_EQ(netlink::hops_of(message).size(), whole ? 2U : 0U) << length;
  }
}

TEST(NetlinkMessage, AHopWithoutItsPaddingIsNone) {
  // A hop of 10 bytes, which takes 12, in an attribute of 11.
  rtnexthop hop{};
  hop.rtnh_ifindex = kCard;
  hop.rtnh_len = 10;
  std::string bytes(11, '\0');
  std::memcpy(bytes.data(), &hop, sizeof hop);
  MessageBuilder builder(RTM_NEWROUTE, route_header());
  builder.put(RTA_MULTIPATH, bytes);
  EXPECT_TRUE(netlink::hops_of(builder.build()).empty());
}

TEST(NetlinkMessage, ANeighbourTellsItsHardwareAddress) {
  ndmsg header{};
  header.ndm_ifindex = kCard;
  header.ndm_state = NUD_REACHABLE;
  for (const bool ethernet : {true, false}) {
    MessageBuilder builder(RTM_NEWNEIGH, header);
    builder.put(NDA_DST, std::string_view("\x0a\x00\x00\x01", 4));
    builder.put(NDA_LLADDR, std::string_view("\x02\x00\x00\x00\x00\x09", ethernet ? 6 : 4));
    const auto found = netlink::neighbour(builder.build());
    ASSERT_TRUE(found);
    EXPECT_EQ(found->card, kCard);
    EXPECT_EQ(found->state, NUD_REACHABLE);
    EXPECT_EQ(found->address.size(), 4U);
    EXPECT_EQ(found->mac.has_value(), ethernet);
  }
}

}  // namespace
}  // namespace interneuron::io::netlink_message_test
