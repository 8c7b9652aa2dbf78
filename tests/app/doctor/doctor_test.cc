// Made-up facts of hosts, one for each row, and what is found in them.
#include <gmock/gmock.h>

#include <cerrno>

#include "app/doctor/judge.h"

namespace interneuron::doctor::doctor_test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using namespace std::chrono_literals;

io::SourceFacts source(const std::string& address, const std::string& nic, int prefix = 24) {
  return {.address = *make_address(address, 0),
          .prefix = prefix,
          .temporary = false,
          .routed = true,
          .leaves_by = nic};
}

io::NicHostFacts healthy_nic(const std::string& name, int index, const std::string& address) {
  io::NicHostFacts nic;
  nic.nic.name = name;
  nic.nic.index = index;
  nic.nic.kind = "wwan";
  nic.nic.admin_up = true;
  nic.nic.mtu = 1500;
  nic.state = NicState::kReady;
  nic.sources = {source(address, name)};
  nic.routed = true;
  nic.send_timestamps = true;
  nic.qdisc = "fq_codel";
  nic.rp_filter = 2;
  nic.arp_ignore = 0;
  nic.arp_announce = 0;
  nic.use_tempaddr = 0;
  return nic;
}

// Two modems, nothing wrong.
io::HostFacts healthy() {
  io::HostFacts host;
  host.target = *make_address("198.51.100.1", 0);
  host.nics = {healthy_nic("wwan0", 3, "10.0.0.2"), healthy_nic("wwan1", 4, "10.1.0.2")};
  host.rp_filter_all = 0;
  host.arp_ignore_all = 0;
  host.arp_announce_all = 0;
  host.rmem_max = 4 << 20;
  host.wmem_max = 4 << 20;
  host.no_pmtu_disc = 0;
  host.conntrack_udp_s = 30;
  host.conntrack_udp_stream_s = 120;
  return host;
}

Finding find(const std::vector<Finding>& findings, const std::string& check,
             const std::string& subject) {
  for (const Finding& f : findings) {
    if (f.check == check && f.subject == subject) return f;
  }
  ADD_FAILURE() << "no finding " << check << " of " << subject;
  return {};
}

Finding of(const io::HostFacts& host, const std::string& check,
           const std::string& subject = "wwan1") {
  return find(judge(host), check, subject);
}

TEST(Doctor, AHealthyHostIsFine) {
  for (const Finding& f : judge(healthy())) {
    EXPECT_EQ(f.verdict, Verdict::kOk) << f.check << " of " << f.subject << ": " << f.found;
    EXPECT_THAT(f.fix, IsEmpty());
  }
}

TEST(Doctor, BindToDevice) {
  auto host = healthy();
  host.nics[1].bind_error = EPERM;
  const Finding f = of(host, "bind_to_device");
  EXPECT_EQ(f.verdict, Verdict::kProblem);
  EXPECT_THAT(f.fix,
              ElementsAre(HasSubstr("setcap cap_net_raw+ep"), HasSubstr("/interneuron-offload\"")));
}

TEST(Doctor, NoRouteThroughACard) {
  auto host = healthy();
  host.nics[1].state = NicState::kNoRoute;
  host.nics[1].routed = false;
  host.nics[1].sources[0].routed = false;
  host.nics[1].nic.gateways = {*make_address("10.1.0.254", 0)};
  EXPECT_THAT(of(host, "route").fix,
              ElementsAre("ip route add default via 10.1.0.254 dev wwan1 metric 1004"));
  EXPECT_EQ(of(host, "route").verdict, Verdict::kProblem);
  host.nics[1].nic.gateways.clear();
  EXPECT_THAT(of(host, "route").fix,
              ElementsAre("ip route add default via 10.1.0.1 dev wwan1 metric 1004"));
  EXPECT_THAT(of(host, "route").found, HasSubstr("guess"));
  host.nics[1].sources[0].prefix = 32;  // point to point
  EXPECT_THAT(of(host, "route").fix, ElementsAre("ip route add default dev wwan1 metric 1004"));
  // A rule for its address is enough: sockets are bound to that too.
  host.nics[1].sources[0].routed = true;
  EXPECT_EQ(of(host, "route").verdict, Verdict::kOk);
}

TEST(Doctor, OnlyOneCardHasADefaultRoute) {
  auto host = healthy();
  EXPECT_EQ(of(host, "cards", "host").verdict, Verdict::kOk);
  host.nics[1].routed = false;
  host.nics[1].sources[0].routed = false;
  EXPECT_EQ(of(host, "cards", "host").verdict, Verdict::kWarning);
  for (auto& nic : host.nics) nic.state = NicState::kNoCarrier;
  EXPECT_EQ(of(host, "cards", "host").verdict, Verdict::kProblem);
}

TEST(Doctor, StrictReversePathFilter) {
  auto host = healthy();
  host.nics[1].rp_filter = 1;
  EXPECT_EQ(of(host, "rp_filter").verdict, Verdict::kOk) << "replies come in where packets leave";
  host.nics[1].sources[0].leaves_by = "wwan0";
  const Finding f = of(host, "rp_filter");
  EXPECT_EQ(f.verdict, Verdict::kProblem);
  EXPECT_THAT(f.fix, ElementsAre("sysctl -w net.ipv4.conf.wwan1.rp_filter=2"));
  EXPECT_THAT(f.found, HasSubstr("through wwan0"));
  // The larger of both counts.
  host.nics[1].rp_filter = 0;
  EXPECT_EQ(of(host, "rp_filter").verdict, Verdict::kOk);
  host.rp_filter_all = 1;
  EXPECT_EQ(of(host, "rp_filter").verdict, Verdict::kProblem);
  host.nics[1].rp_filter = 2;
  EXPECT_EQ(of(host, "rp_filter").verdict, Verdict::kOk);
  host.nics[1].rp_filter.reset();
  EXPECT_EQ(of(host, "rp_filter").verdict, Verdict::kNotChecked);
}

TEST(Doctor, ADotInANameIsNoSeparatorOfASysctl) {
  auto host = healthy();
  host.nics[1].nic.name = "eth0.7";
  host.nics[1].rp_filter = 1;
  EXPECT_THAT(of(host, "rp_filter", "eth0.7").fix,
              ElementsAre("sysctl -w net.ipv4.conf.eth0/7.rp_filter=2"));
}

TEST(Doctor, NoRuleForAnAddress) {
  auto host = healthy();
  host.nics[1].sources[0].leaves_by = "wwan0";
  host.nics[1].table_gateway = *make_address("10.1.0.9", 0);
  const Finding f = of(host, "source_rule");
  EXPECT_EQ(f.verdict, Verdict::kWarning);
  EXPECT_THAT(f.fix, ElementsAre("ip route add default via 10.1.0.9 dev wwan1 table 1004",
                                 "ip rule add from 10.1.0.2 table 1004"));
  EXPECT_EQ(of(host, "source_rule", "wwan0").verdict, Verdict::kOk);
}

TEST(Doctor, SeveralAddressesOnACard) {
  auto host = healthy();
  host.nics[1].sources.push_back(source("10.1.0.3", "wwan1"));
  EXPECT_EQ(of(host, "several_addresses").verdict, Verdict::kWarning);
  EXPECT_THAT(of(host, "several_addresses").found, HasSubstr("--address"));
}

TEST(Doctor, SameSubnetOnTwoCards) {
  auto host = healthy();
  host.nics[0].sources = {source("192.168.8.100", "wwan0")};
  host.nics[1].sources = {source("192.168.8.101", "wwan1")};
  const Finding f = of(host, "same_subnet");
  EXPECT_EQ(f.verdict, Verdict::kProblem);
  EXPECT_THAT(f.found, HasSubstr("192.168.8.0/24 as on wwan0"));
  EXPECT_THAT(f.fix, ElementsAre("sysctl -w net.ipv4.conf.all.arp_ignore=1",
                                 "sysctl -w net.ipv4.conf.all.arp_announce=2"));
  host.arp_ignore_all = 1;
  host.nics[1].arp_announce = 2;
  EXPECT_EQ(of(host, "same_subnet").verdict, Verdict::kOk);
}

TEST(Doctor, SubnetsOverlapWhenOneHoldsTheOther) {
  EXPECT_TRUE(overlap(source("10.0.0.1", "", 8), source("10.200.0.1", "", 24)));
  EXPECT_FALSE(overlap(source("10.0.0.1", "", 16), source("10.1.0.1", "", 16)));
  EXPECT_FALSE(overlap(source("10.0.0.1", "", 0), source("fd00::1", "", 0)));
  EXPECT_EQ(subnet_text(source("fd00:0:1:2:3::7", "", 64)), "fd00:0:1:2::/64");
}

TEST(Doctor, Mtu) {
  auto host = healthy();
  host.nics[1].nic.mtu = 1200;
  EXPECT_EQ(of(host, "mtu").verdict, Verdict::kProblem);
  EXPECT_THAT(of(host, "mtu").fix, ElementsAre("ip link set dev wwan1 mtu 1280"));
  host.nics[1].nic.mtu = 1500;
  host.nics[1].route_mtu = 1300;
  EXPECT_THAT(of(host, "mtu").fix, ElementsAre("ip link set dev wwan1 mtu 1300"));
}

TEST(Doctor, Ipv6) {
  auto host = healthy();
  host.nics[1].sources.push_back(source("fe80::1", "wwan1", 64));
  EXPECT_THAT(of(host, "ipv6").found, HasSubstr("[fe80::1%wwan1]"));
  host.nics[1].sources.push_back(source("2001:db8::2", "wwan1", 64));
  EXPECT_EQ(of(host, "ipv6").verdict, Verdict::kOk);
  host.nics[1].sources.back().temporary = true;
  EXPECT_THAT(of(host, "ipv6").fix, ElementsAre("sysctl -w net.ipv6.conf.wwan1.use_tempaddr=0"));
}

TEST(Doctor, Buffers) {
  auto host = healthy();
  host.rmem_max = 212992;
  EXPECT_EQ(of(host, "receive_buffer", "host").verdict, Verdict::kWarning);
  EXPECT_THAT(of(host, "receive_buffer", "host").fix,
              ElementsAre("sysctl -w net.core.rmem_max=4194304"));
  host.wmem_max = 1000;
  EXPECT_THAT(of(host, "send_buffer", "host").fix,
              ElementsAre("sysctl -w net.core.wmem_max=524288"));
  host.wmem_max.reset();
  EXPECT_EQ(of(host, "send_buffer", "host").verdict, Verdict::kNotChecked);
}

TEST(Doctor, Conntrack) {
  auto host = healthy();
  host.conntrack_udp_s = 5;
  EXPECT_EQ(of(host, "conntrack", "host").verdict, Verdict::kWarning);
  EXPECT_THAT(of(host, "conntrack", "host").fix, testing::SizeIs(2));
  host.conntrack_udp_s.reset();
  EXPECT_EQ(of(host, "conntrack", "host").verdict, Verdict::kOk);
}

TEST(Doctor, PathMtuDiscovery) {
  auto host = healthy();
  host.no_pmtu_disc = 1;
  EXPECT_THAT(of(host, "pmtu_discovery", "host").fix,
              ElementsAre("sysctl -w net.ipv4.ip_no_pmtu_disc=0"));
  host.discover_error = ENOPROTOOPT;
  EXPECT_EQ(of(host, "pmtu_discovery", "host").verdict, Verdict::kProblem);
}

TEST(Doctor, SocketsThatCanDoLess) {
  auto host = healthy();
  host.segmentation_error = host.gro_error = host.timestamping_error = ENOPROTOOPT;
  host.error_queue_error = host.drop_count_error = ENOPROTOOPT;
  host.priority_error = EPERM;
  host.txtime_error = ENOPROTOOPT;
  for (const char* check : {"segmentation_offload", "receive_offload", "timestamping",
                            "error_queue", "drop_count", "priority"}) {
    EXPECT_EQ(of(host, check, "host").verdict, Verdict::kWarning) << check;
  }
  EXPECT_EQ(of(host, "send_time", "host").verdict, Verdict::kOk) << "not needed";
}

TEST(Doctor, CardsThatAreNotUsedAreNotJudged) {
  auto host = healthy();
  host.nics[1].state = NicState::kNoCarrier;
  host.nics[1].nic.admin_up = false;
  const auto findings = judge(host);
  EXPECT_EQ(find(findings, "state", "wwan1").verdict, Verdict::kNotChecked);
  EXPECT_THAT(find(findings, "state", "wwan1").fix, ElementsAre("ip link set dev wwan1 up"));
  EXPECT_EQ(std::ranges::count(findings, "wwan1", &Finding::subject), 1);
}

TEST(DoctorPath, PassesBlackHolesAndRouters) {
  const auto path = [](std::vector<PathMtu::Probe> probes) {
    return PathMtu{.nic = "wwan0", .probes = std::move(probes), .told = {}, .error = 0};
  };
  EXPECT_EQ(judge_path(path({{1228, true}, {1428, true}, {1500, true}}), 1500).verdict,
            Verdict::kOk);
  EXPECT_EQ(judge_path(path({{1228, true}, {1428, true}, {1456, false}}), 1500).verdict,
            Verdict::kOk)
      << "no datagram of ours is larger than 1428 bytes";
  const Finding hole = judge_path(path({{1228, true}, {1308, true}, {1386, false}}), 1500);
  EXPECT_EQ(hole.verdict, Verdict::kProblem);
  EXPECT_THAT(hole.found, HasSubstr("black hole"));
  EXPECT_THAT(hole.fix, ElementsAre("ip link set dev wwan0 mtu 1308"));
  auto told = path({{1228, true}, {1308, true}, {1386, false}});
  told.told = 1358;
  EXPECT_THAT(judge_path(told, 1500).fix, ElementsAre("ip link set dev wwan0 mtu 1358"));
  EXPECT_EQ(judge_path(path({{1228, false}}), 1500).verdict, Verdict::kNotChecked);
  PathMtu refused = path({});
  refused.error = EACCES;
  EXPECT_EQ(judge_path(refused, 1500).verdict, Verdict::kNotChecked);
  EXPECT_THAT(judge_path(refused, 1500).fix, ElementsAre(HasSubstr("ping_group_range")));
}

struct NatCase {
  const char* name;
  int survived, closed;  // s, 0: none
  Verdict verdict;
  const char* says;
};

NatTimeout nat(int survived, int closed) {
  NatTimeout measured{.nic = "wwan0", .limit = 60s, .flows = {}, .cut_short = {}};
  measured.flows.answered = true;
  if (survived > 0) measured.flows.survived = probe::Silence(survived);
  if (closed > 0) measured.flows.closed = probe::Silence(closed);
  return measured;
}

TEST(DoctorNat, AMappingMustOutliveTwoSignsOfLife) {
  for (const NatCase& c : {
           NatCase{"not even the shortest", 0, 5, Verdict::kProblem, "closed after 5 s"},
           NatCase{"one is too late", 5, 10, Verdict::kProblem, "after 5 s of silence"},
           NatCase{"one is just too late", 10, 15, Verdict::kProblem, "every 15 s"},
           NatCase{"none may be lost", 15, 20, Verdict::kWarning, "every 15 s"},
           NatCase{"none may be lost", 20, 30, Verdict::kWarning, "closed after 30 s"},
           NatCase{"one may be lost", 30, 60, Verdict::kOk, "closed after 60 s"},
           NatCase{"all were survived", 60, 0, Verdict::kOk, "longer was not tried"},
           NatCase{"long enough as far as known", 15, 0, Verdict::kOk, "longer was not tried"},
           NatCase{"only short ones were tried", 10, 0, Verdict::kNotChecked, "--nat-timeout 30"},
       }) {
    const Finding f = judge_nat(nat(c.survived, c.closed));
    EXPECT_EQ(f.check, "nat_timeout");
    EXPECT_EQ(f.subject, "wwan0");
    EXPECT_EQ(f.verdict, c.verdict) << c.name;
    EXPECT_THAT(f.found, HasSubstr(c.says));
    EXPECT_THAT(f.fix, IsEmpty());
  }
}

TEST(DoctorNat, WhatCouldNotBeMeasuredIsSaid) {
  const auto says = [](const NatTimeout& measured, const char* text) {
    const Finding f = judge_nat(measured);
    EXPECT_EQ(f.verdict, Verdict::kNotChecked);
    EXPECT_THAT(f.found, HasSubstr(text));
  };
  NatTimeout measured = nat(0, 0);
  says(measured, "too many packets are lost");
  measured.flows.refused = true;
  says(measured, "no room");
  measured.flows.answered = false;
  says(measured, "interneuron road");
  measured.limit = 0s;
  says(measured, "--nat-timeout");
  measured = nat(5, 10);
  measured.cut_short = "interrupted";
  says(measured, "interrupted; so far: UDP flows are open after 5 s");
  measured = nat(0, 0);
  measured.cut_short = "interrupted";
  EXPECT_EQ(judge_nat(measured).found, "interrupted");
}

}  // namespace
}  // namespace interneuron::doctor::doctor_test
