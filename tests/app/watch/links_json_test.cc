#include "app/watch/json.h"

#include <gmock/gmock.h>

#include "app/watch/table.h"
#include "json_schema.h"
#include "links_support.h"

namespace interneuron::watch::links_json_test {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

TEST(LinksJson, IsAsTheSchemaSays) {
  const Json json = links_json(made_up_snapshot());
  EXPECT_THAT(violations(schema_of("links.json"), nlohmann::json(json)), IsEmpty());
  EXPECT_EQ(json["links"].size(), 2U);
  const Json& link = json["links"][0];
  EXPECT_EQ(link["rtt_ms"]["p50"], 20.0);
  EXPECT_EQ(link["rate_mbit"]["down"], 100.0);
  EXPECT_EQ(link["loss"], 0.013);
  EXPECT_EQ(link["traits"]["rate_cap_mbit"], 20.0);
  EXPECT_EQ(link["nature"]["bandwidth"], 0.5);
  EXPECT_EQ(link["evidence"]["rate_age_s"], 2.5);
  EXPECT_EQ(link["evidence"]["handshake_packets"], 3);
  EXPECT_EQ(link["evidence"]["unauthentic_packets"], 4);
  EXPECT_TRUE(json["links"][1]["rtt_ms"].is_null());
  const Json& program = json["programs"][0];
  EXPECT_EQ(program["loop_stall_ms"], 4.5);
  EXPECT_EQ(program["peers"].size(), 2U);
  EXPECT_EQ(program["peers"][0]["contexts"], 3);
  EXPECT_EQ(program["peers"][0]["struck"]["origin"], 7);
  EXPECT_EQ(program["peers"][0]["work"]["computed"], 340);
  EXPECT_TRUE(program["peers"][1]["work"].is_null());
}

TEST(LinksJson, TheSchemaIsNotBlind) {
  nlohmann::json json(links_json(made_up_snapshot()));
  json["links"][0]["rtt"] = 20;
  json["links"][0].erase("loss");
  json["links"][0]["state"] = "fine";
  json["links"][0]["nature"]["delay"] = 2;
  EXPECT_EQ(violations(schema_of("links.json"), json).size(), 4U);
}

TEST(LinksJson, WhatWasNeverMeasuredIsNull) {
  LinksSnapshot s = made_up_snapshot();
  Measured silent;
  silent.program = "links";
  silent.state.age = Duration::max();
  silent.state.rate_age = Duration::max();
  s.rows[0].measured = silent;
  const Json json = links_json(s);
  EXPECT_THAT(violations(schema_of("links.json"), nlohmann::json(json)), IsEmpty());
  EXPECT_TRUE(json["links"][0]["age_s"].is_null());
  EXPECT_TRUE(json["links"][0]["rtt_ms"]["p50"].is_null());
  EXPECT_TRUE(json["links"][0]["rate_mbit"]["up"].is_null());
}

TEST(LiveJson, ComesBackAsItWas) {
  LiveLinks live;
  live.program = "vehicle";
  live.pid = 42;
  live.links = {{"wwan0", made_up_figures()}, {"wwan1", made_up_figures(70, 5)}};
  live.links[1].measured.state.age = Duration::max();
  live.links[1].measured.state.traits = {};
  live.events = made_up_snapshot().events;
  live.loop_stall = from_ms(4.5);
  live.peers = made_up_snapshot().programs[0].peers;
  const auto back = live_from_json(live_json(live).dump());
  ASSERT_TRUE(back);
  EXPECT_EQ(live_json(*back), live_json(live));
  EXPECT_EQ(back->links[0].measured.state.rtt_p50, from_ms(20));
  EXPECT_EQ(back->links[0].measured.counters.unauthentic_packets, 4U);
  EXPECT_EQ(back->links[1].measured.state.age, Duration::max());
  EXPECT_EQ(back->events, live.events);
  EXPECT_EQ(back->loop_stall, live.loop_stall);
  ASSERT_EQ(back->peers.size(), 2U);
  EXPECT_EQ(back->peers[0].ledger.reassembly_bytes, 12'000U);
  EXPECT_EQ(back->peers[0].ledger.struck(PeerLimit::kOrigin), 7U);
}

TEST(LiveJson, WhatIsNoLiveStateIsNothing) {
  const std::string good = live_json({.program = "x", .pid = 1, .links = {}, .events = {}}).dump();
  EXPECT_TRUE(live_from_json(good));
  for (const std::string& text :
       {std::string(), std::string("{"), std::string("[]"), std::string("{\"schema\":1}"),
        good.substr(0, good.size() / 2), std::string("{\"schema\":\"interneuron.live/2\"}")}) {
    EXPECT_FALSE(live_from_json(text)) << text;
  }
}

// Each of these in place of a figure that fits; a conversion would otherwise be undefined.
TEST(LiveJson, FiguresThatNoLinkHasAreRefused) {
  LiveLinks live{.program = "x", .pid = 1, .links = {{"eth0", made_up_figures()}}, .events = {}};
  const Json good = live_json(live);
  ASSERT_TRUE(live_from_json(good.dump()));
  const std::pair<const char*, Json> wrong[] = {{"/links/0/rtt_ms/p50", 1e300},
                                                {"/links/0/age_s", -1e300},
                                                {"/links/0/rate_mbit/up", 1e30},
                                                {"/links/0/evidence/loss_down", 1e308},
                                                {"/links/0/traits/priority", 1e300},
                                                {"/links/0/traits/priority", 4294967296},
                                                {"/links/0/peer", -1},
                                                {"/links/0/evidence/sent_bytes", -1},
                                                {"/links/0/evidence/sent_packets", 1.5},
                                                {"/pid", 1e300}};
  for (const auto& [where, value] : wrong) {
    Json bad = good;
    bad[Json::json_pointer(where)] = value;
    EXPECT_FALSE(live_from_json(bad.dump())) << where << " " << value;
  }
}

TEST(LiveJson, NothingOfItReachesATerminalRaw) {
  LiveLinks live{.program = "v\x1b[2J", .pid = 1, .links = {}, .events = {}};
  live.events = {{TimePoint{}, "a\n", "ready", "no_carrier", "\x07gone"}};
  const auto back = live_from_json(live_json(live).dump());
  ASSERT_TRUE(back);
  EXPECT_EQ(back->program, "v?[2J");
  EXPECT_EQ(back->events[0].nic, "a?");
  EXPECT_EQ(back->events[0].reason, "?gone");
}

TEST(Join, AnyNicHasARowAndAMeasuredOneARowPerPeer) {
  LiveLinks live{.program = "road", .pid = 1, .links = {}, .events = {}};
  live.links = {{"eth0", made_up_figures()}, {"eth0", made_up_figures()}, {"gone", {}}};
  live.links[1].measured.peer = 2;
  const auto rows = join({made_up_nic("lo", "127.0.0.1"), made_up_nic("eth0", "10.0.0.2")}, {live});
  ASSERT_EQ(rows.size(), 3U);
  EXPECT_FALSE(rows[0].measured);
  EXPECT_EQ(rows[1].measured->peer, 1U);
  EXPECT_EQ(rows[2].measured->peer, 2U);
}

TEST(LinksTable, SaysWhatIsKnownAndDashesWhatIsNot) {
  const std::string text = links_table(made_up_snapshot());
  EXPECT_THAT(text, HasSubstr("wwan0  wwan  ready       10.0.0.2  10.0.0.1  1428  up    qmi_wwan"));
  EXPECT_THAT(text, testing::ContainsRegex("wwan0 +ok +20\\.0 +30\\.0 +1\\.5 +1\\.3 +50\\.0 +100 "
                                           "+0\\.1s +1\\.00 +0\\.50 +0\\.25 +0\\.00"));
  EXPECT_THAT(text, HasSubstr("wwan1  –"));
  EXPECT_THAT(text, HasSubstr("wwan1: no_carrier: carrier lost"));
  EXPECT_THAT(text, HasSubstr("measured by vehicle (process 7)"));
  EXPECT_THAT(text, Not(HasSubstr("BY, PEER")));
}

TEST(LinksTable, TellsSeveralPeersApart) {
  LinksSnapshot s = made_up_snapshot();
  s.rows.push_back(s.rows[0]);
  s.rows.back().measured->peer = 2;
  EXPECT_THAT(links_table(s), HasSubstr("BY, PEER"));
}

TEST(LinksTable, LoopbackIsLeftOutUnlessItIsMeasured) {
  LinksSnapshot s = made_up_snapshot();
  s.rows.push_back({made_up_nic("lo", "127.0.0.1"), std::nullopt});
  s.rows.back().facts.nic.kind = "loopback";
  EXPECT_THAT(links_table(s), Not(HasSubstr("127.0.0.1")));
  s.rows.back().measured = made_up_figures();
  EXPECT_THAT(links_table(s), HasSubstr("127.0.0.1"));
}

TEST(LinksCells, AreShort) {
  EXPECT_EQ(ms_text(from_ms(0.384)), "0.38");
  EXPECT_EQ(ms_text(from_ms(18.43)), "18.4");
  EXPECT_EQ(ms_text(from_ms(173.2)), "173");
  EXPECT_EQ(ms_text(Duration{}), kNothing);
  EXPECT_EQ(mbit_text(DataRate::mbit(0.34)), "0.3");
  EXPECT_EQ(mbit_text(DataRate::mbit(328.4)), "328");
  EXPECT_EQ(percent_text(1), "100");
  EXPECT_EQ(age_text(Duration::max()), kNothing);
  EXPECT_EQ(age_text(from_ms(200'000)), "3m");
  EXPECT_EQ(fitted("abcdef", 4), "abc…");
  EXPECT_EQ(fitted("–", 3, true), "  –");
  EXPECT_EQ(address_text({*make_address("fe80::1", 0), *make_address("10.0.0.2", 0)}),
            "10.0.0.2 +1");
}

}  // namespace
}  // namespace interneuron::watch::links_json_test
