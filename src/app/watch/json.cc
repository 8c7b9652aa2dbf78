#include "app/watch/json.h"

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstdint>
#include <stdexcept>
#include <utility>

#include "node/io/address.h"

namespace interneuron::watch {
namespace {

// --- Numbers out of JSON that another process wrote and that may be anything: each is in range or
// throws std::exception.

// More than any figure of a link has, in the units of the keys (31 years in ms), and little enough
// that no conversion of it overflows.
constexpr double kMostFigure = 1e12;

// nlohmann's own get() gives whatever a conversion leaves of a number that does not fit.
double figure_of(const nlohmann::ordered_json& j) {
  const auto value = j.get<double>();
  if (!(std::abs(value) <= kMostFigure)) throw std::invalid_argument("a figure of no link");
  return value;
}

template <std::integral Integer>
Integer whole_of(const nlohmann::ordered_json& j) {
  if (j.is_number_unsigned() && std::in_range<Integer>(j.get<std::uint64_t>())) {
    return static_cast<Integer>(j.get<std::uint64_t>());
  }
  if (j.is_number_integer() && std::in_range<Integer>(j.get<std::int64_t>())) {
    return static_cast<Integer>(j.get<std::int64_t>());
  }
  throw std::invalid_argument("no whole number that fits");
}

// --- What a program keeps of its peers (PeerLedger).

// Microseconds are exact enough.
double rounded_ms(Duration d) { return std::round(to_ms(d) * 1e3) / 1e3; }

PeerLimit limit_at(std::size_t i) { return static_cast<PeerLimit>(i); }

Json work_json(const computing::PeerWork& work) {
  return {{"waiting", work.waiting},         {"computed", work.computed},
          {"crowded_out", work.crowded_out}, {"too_late", work.too_late},
          {"unreadable", work.unreadable},   {"busy_ms", rounded_ms(work.busy)}};
}

computing::PeerWork work_of(const Json& json) {
  return {.waiting = whole_of<std::size_t>(json.at("waiting")),
          .computed = whole_of<std::uint64_t>(json.at("computed")),
          .crowded_out = whole_of<std::uint64_t>(json.at("crowded_out")),
          .too_late = whole_of<std::uint64_t>(json.at("too_late")),
          .unreadable = whole_of<std::uint64_t>(json.at("unreadable")),
          .busy = from_ms(figure_of(json.at("busy_ms")))};
}

Json peer_json(const LivePeer& peer) {
  const PeerLedger& l = peer.ledger;
  Json struck = Json::object();
  for (std::size_t i = 0; i < kPeerLimitCount; ++i) {
    struck[std::string(to_string(limit_at(i)))] = l.strikes[i];
  }
  return {{"peer", peer.peer},
          {"contexts", l.contexts},
          {"pipelines", l.pipelines},
          {"held_messages", l.held_messages},
          {"held_bytes", l.held_bytes},
          {"reassembly_messages", l.reassembly_messages},
          {"reassembly_bytes", l.reassembly_bytes},
          {"longest_lifetime_ms", rounded_ms(l.longest_lifetime)},
          {"struck", std::move(struck)},
          {"work", peer.work ? work_json(*peer.work) : Json()}};
}

LivePeer peer_of(const Json& json) {
  LivePeer peer;
  PeerLedger& l = peer.ledger;
  peer.peer = whole_of<std::uint32_t>(json.at("peer"));
  l.contexts = whole_of<std::size_t>(json.at("contexts"));
  l.pipelines = whole_of<std::size_t>(json.at("pipelines"));
  l.held_messages = whole_of<std::size_t>(json.at("held_messages"));
  l.held_bytes = whole_of<std::size_t>(json.at("held_bytes"));
  l.reassembly_messages = whole_of<std::size_t>(json.at("reassembly_messages"));
  l.reassembly_bytes = whole_of<std::size_t>(json.at("reassembly_bytes"));
  l.longest_lifetime = from_ms(figure_of(json.at("longest_lifetime_ms")));
  for (std::size_t i = 0; i < kPeerLimitCount; ++i) {
    l.strikes[i] =
        whole_of<std::uint64_t>(json.at("struck").at(std::string(to_string(limit_at(i)))));
  }
  const Json& work = json.at("work");
  if (!work.is_null()) peer.work = work_of(work);
  return peer;
}

// "loop_stall_ms" and "peers", each with what it holds, how often each limit has struck it and what
// is computed for it.
Json ledgers_json(Duration loop_stall, const std::vector<LivePeer>& peers) {
  Json json{{"loop_stall_ms", rounded_ms(loop_stall)}, {"peers", Json::array()}};
  for (const LivePeer& peer : peers) json["peers"].push_back(peer_json(peer));
  return json;
}

// What ledgers_json() has written. The text comes from another process: an exception of the JSON
// library where it is anything else.
Duration loop_stall_of(const Json& json) { return from_ms(figure_of(json.at("loop_stall_ms"))); }

std::vector<LivePeer> peers_of(const Json& json) {
  std::vector<LivePeer> peers;
  for (const Json& peer : json.at("peers")) peers.push_back(peer_of(peer));
  return peers;
}

// --- Links.

constexpr Duration kNever = Duration::max();

// Digits behind the point: microseconds and kbit/s, and loss to a packet in a million.
double rounded(double value, double scale = 1e3) { return std::round(value * scale) / scale; }

Json ms(Duration d) { return d > Duration::zero() ? Json(rounded(to_ms(d))) : Json(nullptr); }
Json mbit(DataRate r) { return r.bits_per_second > 0 ? Json(rounded(r.mbit())) : Json(nullptr); }
Json seconds(Duration d) { return d == kNever ? Json(nullptr) : Json(rounded(to_ms(d) / 1000)); }

Json traits_json(const LinkTraits& t) {
  return {{"role", to_string(t.role)},
          {"priority", t.priority},
          {"metered", t.metered},
          {"rate_cap_mbit", t.rate_cap ? Json(t.rate_cap->mbit()) : Json(nullptr)},
          {"trusted", t.trusted}};
}

Json evidence_json(const Measured& m) {
  const LinkState& s = m.state;
  return {
      {"rtt_min_ms", ms(s.rtt_min)},
      {"queue_ms", {{"up", rounded(to_ms(s.queue_up))}, {"down", rounded(to_ms(s.queue_down))}}},
      {"loss_down", rounded(s.loss_down, 1e6)},
      {"loss_burst_packets", rounded(s.loss_burst)},
      {"outage", rounded(s.outage, 1e6)},
      {"ecn", to_string(s.ecn)},
      {"rate_age_s", seconds(s.rate_age)},
      {"duplicate_packets", m.counters.duplicate_packets},
      {"malformed_packets", m.counters.malformed_packets},
      {"other_version_packets", m.counters.other_version_packets},
      {"other_packets", m.counters.other_packets},
      {"refused_packets", m.counters.refused_packets},
      {"sent_packets", m.counters.sent_packets},
      {"received_packets", m.counters.received_packets},
      {"sent_bytes", m.counters.sent_bytes},
      {"received_bytes", m.counters.received_bytes},
      {"handshake_packets", m.counters.handshake_packets},
      {"unauthentic_packets", m.counters.unauthentic_packets},
      {"path_reason", m.path_reason}};
}

// The keys that stand for what was measured; also of a link without a measurement.
Json measured_json(const std::optional<Measured>& measured) {
  const auto value = [&](auto&& get) { return measured ? get(*measured) : Json(nullptr); };
  const auto state = [&](auto&& get) { return measured ? get(measured->state) : Json(nullptr); };
  using S = const LinkState&;
  return {{"program", value([](const Measured& m) { return Json(m.program); })},
          {"peer", value([](const Measured& m) { return Json(m.peer); })},
          {"path", state([](S s) { return Json(to_string(s.path)); })},
          {"usable", state([](S s) { return Json(s.up); })},
          {"rtt_ms", state([](S s) {
             return Json{{"p50", ms(s.rtt_p50)}, {"p95", ms(s.rtt_p95)}};
           })},
          {"jitter_ms", state([](S s) { return ms(s.jitter); })},
          {"loss", state([](S s) { return Json(rounded(s.loss, 1e6)); })},
          {"rate_mbit", state([](S s) {
             return Json{{"up", mbit(s.rate)}, {"down", mbit(s.rate_down)}};
           })},
          {"age_s", state([](S s) { return seconds(s.age); })},
          {"confidence", state([](S s) { return Json(rounded(s.confidence)); })},
          {"nature", state([](S s) {
             return Json{{"delay", rounded(s.nature.delay)},
                         {"bandwidth", rounded(s.nature.bandwidth)},
                         {"reliability", rounded(s.nature.reliability)},
                         {"security", rounded(s.nature.security)}};
           })},
          {"traits", state([](S s) { return traits_json(s.traits); })},
          {"evidence", value(evidence_json)}};
}

Json hosts(const std::vector<Address>& addresses) {
  Json list = Json::array();
  for (const Address& address : addresses) list.push_back(io::host_text(address));
  return list;
}

Json row_json(const LinkRow& row) {
  const io::Nic& nic = row.facts.nic;
  Json json{{"name", nic.name},
            {"kind", nic.kind},
            {"state", to_string(row.facts.state)},
            {"reason", row.facts.reason},
            {"addresses", hosts(nic.addresses)},
            {"gateways", hosts(nic.gateways)},
            {"mtu_bytes", nic.mtu},
            {"operstate", nic.operstate},
            {"driver", nic.driver},
            {"mac", nic.mac}};
  json.update(measured_json(row.measured));
  return json;
}

Json event_json(const LinkEvent& e) {
  return {{"at_monotonic_ns", e.at.time_since_epoch().count()},
          {"name", e.nic},
          {"from", e.from},
          {"to", e.to},
          {"reason", e.reason}};
}

// --- and back

template <class Enum>
Enum enum_of(const std::string& name, std::initializer_list<Enum> all) {
  for (const Enum value : all) {
    if (to_string(value) == name) return value;
  }
  throw std::invalid_argument(name);
}

Duration ms_of(const Json& j) { return j.is_null() ? Duration{} : from_ms(figure_of(j)); }
Duration age_of(const Json& j) {
  return j.is_null() ? kNever : from_ms(std::clamp(figure_of(j) * 1000, -kMostFigure, kMostFigure));
}
DataRate rate_from(const Json& j) {
  return j.is_null() ? DataRate{} : DataRate::mbit(figure_of(j));
}

LinkTraits traits_of(const Json& j) {
  LinkTraits t;
  t.role = enum_of(j.at("role").get<std::string>(),
                   {LinkRole::kNormal, LinkRole::kBackup, LinkRole::kNever});
  t.priority = whole_of<int>(j.at("priority"));
  t.metered = j.at("metered").get<bool>();
  if (!j.at("rate_cap_mbit").is_null()) t.rate_cap = rate_from(j.at("rate_cap_mbit"));
  t.trusted = j.at("trusted").get<bool>();
  return t;
}

LinkState state_of(const Json& j) {
  LinkState s;
  const Json& e = j.at("evidence");
  s.path = enum_of(j.at("path").get<std::string>(),
                   {PathState::kOk, PathState::kSuspect, PathState::kPulled, PathState::kLatched,
                    PathState::kDead});
  s.up = j.at("usable").get<bool>();
  s.traits = traits_of(j.at("traits"));
  s.rtt_p50 = ms_of(j.at("rtt_ms").at("p50"));
  s.rtt_p95 = ms_of(j.at("rtt_ms").at("p95"));
  s.rtt_min = ms_of(e.at("rtt_min_ms"));
  s.jitter = ms_of(j.at("jitter_ms"));
  s.queue_up = ms_of(e.at("queue_ms").at("up"));
  s.queue_down = ms_of(e.at("queue_ms").at("down"));
  s.rate = rate_from(j.at("rate_mbit").at("up"));
  s.rate_down = rate_from(j.at("rate_mbit").at("down"));
  s.loss = figure_of(j.at("loss"));
  s.loss_down = figure_of(e.at("loss_down"));
  s.loss_burst = figure_of(e.at("loss_burst_packets"));
  s.outage = figure_of(e.at("outage"));
  s.ecn = enum_of(e.at("ecn").get<std::string>(),
                  {EcnState::kTesting, EcnState::kWorks, EcnState::kBleached, EcnState::kRewritten,
                   EcnState::kMangled, EcnState::kDropped});
  s.age = age_of(j.at("age_s"));
  s.rate_age = age_of(e.at("rate_age_s"));
  s.confidence = figure_of(j.at("confidence"));
  const Json& n = j.at("nature");
  s.nature = {figure_of(n.at("delay")), figure_of(n.at("bandwidth")),
              figure_of(n.at("reliability")), figure_of(n.at("security"))};
  return s;
}

Measured measured_of(const Json& j) {
  Measured m;
  m.program = printable(j.at("program").get<std::string>());
  m.peer = whole_of<std::uint32_t>(j.at("peer"));
  m.state = state_of(j);
  const Json& e = j.at("evidence");
  m.path_reason = printable(e.at("path_reason").get<std::string>());
  m.counters.duplicate_packets = whole_of<std::uint64_t>(e.at("duplicate_packets"));
  m.counters.malformed_packets = whole_of<std::uint64_t>(e.at("malformed_packets"));
  m.counters.other_version_packets = whole_of<std::uint64_t>(e.at("other_version_packets"));
  m.counters.other_packets = whole_of<std::uint64_t>(e.at("other_packets"));
  m.counters.refused_packets = whole_of<std::uint64_t>(e.at("refused_packets"));
  m.counters.sent_packets = whole_of<std::uint64_t>(e.at("sent_packets"));
  m.counters.received_packets = whole_of<std::uint64_t>(e.at("received_packets"));
  m.counters.sent_bytes = whole_of<std::uint64_t>(e.at("sent_bytes"));
  m.counters.received_bytes = whole_of<std::uint64_t>(e.at("received_bytes"));
  m.counters.handshake_packets = whole_of<std::uint64_t>(e.at("handshake_packets"));
  m.counters.unauthentic_packets = whole_of<std::uint64_t>(e.at("unauthentic_packets"));
  return m;
}

}  // namespace

Json links_json(const LinksSnapshot& snapshot) {
  Json json{{"schema", "interneuron.links/1"},
            {"unix_ms", snapshot.unix_ms},
            {"source", snapshot.source},
            {"links", Json::array()},
            {"programs", Json::array()}};
  for (const LinkRow& row : snapshot.rows) json["links"].push_back(row_json(row));
  for (const LiveProgram& p : snapshot.programs) {
    Json program{{"program", p.program}, {"pid", p.pid}};
    program.update(ledgers_json(p.loop_stall, p.peers));
    json["programs"].push_back(std::move(program));
  }
  return json;
}

Json live_json(const LiveLinks& live) {
  Json json{{"schema", "interneuron.live/1"},
            {"program", live.program},
            {"pid", live.pid},
            {"links", Json::array()},
            {"events", Json::array()}};
  json.update(ledgers_json(live.loop_stall, live.peers));
  for (const LiveLinks::Link& link : live.links) {
    Json item = measured_json(link.measured);
    item["name"] = link.nic;
    json["links"].push_back(std::move(item));
  }
  for (const LinkEvent& event : live.events) json["events"].push_back(event_json(event));
  return json;
}

std::optional<LiveLinks> live_from_json(const std::string& text) {
  try {
    const Json json = Json::parse(text);
    if (json.at("schema") != "interneuron.live/1") return std::nullopt;
    LiveLinks live;
    live.program = printable(json.at("program").get<std::string>());
    live.pid = whole_of<std::int64_t>(json.at("pid"));
    live.loop_stall = loop_stall_of(json);
    live.peers = peers_of(json);
    for (const Json& item : json.at("links")) {
      live.links.push_back({printable(item.at("name").get<std::string>()), measured_of(item)});
    }
    for (const Json& item : json.at("events")) {
      live.events.push_back(
          {TimePoint{Duration{whole_of<std::int64_t>(item.at("at_monotonic_ns"))}},
           printable(item.at("name").get<std::string>()),
           printable(item.at("from").get<std::string>()),
           printable(item.at("to").get<std::string>()),
           printable(item.at("reason").get<std::string>())});
    }
    return live;
  } catch (const std::exception&) {
    // The text is no JSON, or of another version of the program.
    return std::nullopt;
  }
}

}  // namespace interneuron::watch
