#include "lab/load/scenario.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "interneuron/sizes.h"
#include "lab/emu/random.h"

namespace interneuron::load {
namespace {

using namespace std::chrono_literals;

// The conditions of all scenarios: a deadline of one and a half frames of a camera, and half the
// round trip of a 5G modem with a good connection (docs/constants.md).
constexpr Duration kDeadline = 150ms;
constexpr Duration kOneWay = 20ms;
// A queue as of a managed cell, and one as cellular base stations are known to have.
constexpr std::array<Duration, 2> kQueues{30ms, 300ms};

constexpr std::array<std::string_view, kPeers> kPeerNames{
    "ours",       "ours_variants", "udp",     "cubic", "bbr_like",
    "mptcp_like", "tcp_cubic",     "tcp_bbr", "mptcp"};
constexpr std::array kModelled{Peer::kOurs,  Peer::kOursVariants, Peer::kUdp,
                               Peer::kCubic, Peer::kBbrLike,      Peer::kMptcpLike};
constexpr std::array kReal{Peer::kOurs,     Peer::kOursVariants, Peer::kUdp,
                           Peer::kTcpCubic, Peer::kTcpBbr,       Peer::kMptcp};

constexpr std::array<Group, 8> kGroups{{
    {"rate", "One vehicle, messages that take a third of the deadline, ever more often", true},
    {"size", "One vehicle, 10 messages a second, ever larger", true},
    {"vehicles", "Many vehicles in one cell of 60 Mbit/s, each with its share of the load", true},
    {"late", "Ten vehicles offer twice the rate of a cell, the last one begins later", false},
    {"cubic", "One vehicle beside a flow of CUBIC: three times the cell, and half of its share",
     false},
    {"ecn", "One vehicle and many in a cell that marks packets: CoDel, and a step for L4S", false},
    {"dip", "60 Mbit/s fall to 6 for 3 s and come back", false},
    {"fleet", "200 vehicles with 10 messages of 5 KB a second each, in a cell that has room",
     false},
}};

// A link and the messages that take about a third of the deadline on it.
struct Bottleneck {
  double mbit;
  std::size_t message_bytes;
};
constexpr std::array<Bottleneck, 2> kBottlenecks{{{20, 48 * 1024}, {60, 128 * 1024}}};

constexpr std::array kRateLoads{0.5, 0.8, 0.95, 1.05, 1.2, 1.5, 2.0, 3.0};
constexpr std::array kSizeLoads{0.95, 1.0, 1.05, 1.1, 1.2};

// So many vehicles share a cell of kCellMbit. A message takes 46 ms at a vehicle's fair share, less
// than half of the deadline: 32 KiB where there are ten.
constexpr double kCellMbit = 60;
constexpr std::size_t kSharedBytes = std::size_t{320} * 1024;
struct Crowd {
  std::size_t vehicles;
  double load;
};
constexpr std::array<Crowd, 4> kCrowds{{{2, 2.0}, {10, 1.06}, {10, 2.0}, {50, 2.0}}};

std::vector<double> or_default(const std::vector<double>& chosen, std::span<const double> own) {
  return chosen.empty() ? std::vector<double>(own.begin(), own.end()) : chosen;
}

std::string named(double mbit, Duration queue) {
  return std::to_string(std::lround(mbit)) + "mbit-" + std::to_string(queue / 1ms) + "ms";
}

Scenario base(const Choice& choice, std::string_view group, double mbit, Duration queue) {
  Scenario s;
  s.group = group;
  s.name = named(mbit, queue);
  s.capacity = DataRate::mbit(mbit);
  s.queue = queue;
  s.one_way = kOneWay;
  s.deadline = kDeadline;
  s.length = choice.length;
  s.seed = choice.seed;
  s.is_encrypted = choice.is_encrypted;
  s.is_spread = choice.is_spread;
  s.is_cross_bbr = choice.is_cross_bbr;
  return s;
}

// How often each of so many vehicles sends a message of this size for this load.
Duration period_for(const Scenario& s) {
  const Duration on_wire = s.capacity.transmit_time(ip_bytes_of(s.message_bytes));
  return Duration{std::llround(static_cast<double>(on_wire.count()) *
                               static_cast<double>(s.vehicles) / s.load)};
}

// The size of message for this load at the period that is set.
std::size_t bytes_for(const Scenario& s) {
  const double wire =
      static_cast<double>(s.capacity.bits_per_second) / 8 * s.load * to_seconds(s.period);
  // The framing of messages of this size hardly depends on the size.
  return static_cast<std::size_t>(wire * payload_share(static_cast<std::size_t>(wire)));
}

std::vector<Scenario> rate(const Choice& choice) {
  std::vector<Scenario> out;
  for (const Bottleneck& b : kBottlenecks) {
    for (const Duration queue : kQueues) {
      for (const double load : or_default(choice.loads, kRateLoads)) {
        Scenario s = base(choice, "rate", b.mbit, queue);
        s.load = load;
        s.message_bytes = b.message_bytes;
        s.period = period_for(s);
        out.push_back(std::move(s));
      }
    }
  }
  return out;
}

std::vector<Scenario> size(const Choice& choice) {
  std::vector<Scenario> out;
  for (const Duration queue : kQueues) {
    for (const double load : or_default(choice.loads, kSizeLoads)) {
      Scenario s = base(choice, "size", 20, queue);
      s.load = load;
      s.period = kCameraPeriod;
      s.message_bytes = bytes_for(s);
      out.push_back(std::move(s));
    }
  }
  return out;
}

Scenario crowd(const Choice& choice, std::string_view group, const Crowd& crowd) {
  Scenario s = base(choice, group, kCellMbit, kQueues[1]);
  s.name = std::to_string(crowd.vehicles) + "-vehicles";
  s.vehicles = crowd.vehicles;
  s.load = crowd.load;
  s.message_bytes = kSharedBytes / crowd.vehicles;
  s.period = period_for(s);
  return s;
}

std::vector<Scenario> vehicles(const Choice& choice) {
  std::vector<Scenario> out;
  if (choice.loads.empty()) {
    for (const Crowd& c : kCrowds) out.push_back(crowd(choice, "vehicles", c));
    return out;
  }
  for (const std::size_t n : {std::size_t{2}, std::size_t{10}, std::size_t{50}}) {
    for (const double load : choice.loads) out.push_back(crowd(choice, "vehicles", {n, load}));
  }
  return out;
}

std::vector<Scenario> late(const Choice& choice) {
  Scenario s = crowd(choice, "late", {10, 2.0});
  // Long enough for the others to have settled, and as long again to see it through.
  s.late = choice.length / 3;
  return {s};
}

std::vector<Scenario> cubic(const Choice& choice) {
  constexpr double kUnlimited = 3;
  std::vector<Scenario> out;
  for (const bool codel : {false, true}) {
    for (const Duration queue : kQueues) {
      if (codel && queue != kQueues[1]) continue;
      Scenario s = base(choice, "cubic", kCellMbit, queue);
      if (codel) s.name = "60mbit-codel";
      s.codel = codel;
      s.load = kUnlimited;
      s.message_bytes = kBottlenecks[1].message_bytes;
      s.period = period_for(s);
      s.cross_flows = 1;
      out.push_back(std::move(s));
    }
  }
  for (const Duration queue : {Duration{100ms}, Duration{300ms}}) {
    Scenario s = base(choice, "cubic", 20, queue);
    s.name += "-half";
    s.deadline = 2 * queue;
    s.load = 0.25;
    s.period = kCameraPeriod;
    s.message_bytes = bytes_for(s);
    s.cross_flows = 1;
    out.push_back(std::move(s));
  }
  return out;
}

std::vector<Scenario> ecn(const Choice& choice) {
  constexpr std::array<Crowd, 4> kMarked{{{1, 1.5}, {2, 2.0}, {10, 2.0}, {50, 2.0}}};
  std::vector<Scenario> out;
  for (const Crowd& c : kMarked) {
    for (const bool l4s : {false, true}) {
      Scenario s = crowd(choice, "ecn", c);
      if (c.vehicles == 1) {
        s.message_bytes = kBottlenecks[1].message_bytes;
        s.period = period_for(s);
      }
      s.name = (l4s ? "l4s-" : "codel-") + std::to_string(c.vehicles);
      s.codel = !l4s;
      s.l4s = l4s;
      out.push_back(std::move(s));
    }
  }
  return out;
}

std::vector<Scenario> dip(const Choice& choice) {
  constexpr std::size_t kWhole = 128 * 1024;
  constexpr std::size_t kSmall = 16 * 1024;
  constexpr std::size_t kTiny = 1024;
  constexpr Dip kDip{.at = 3s, .length = 3s, .rate = DataRate::mbit(6)};
  // Long enough to see what becomes of the vehicle after the dip.
  constexpr Duration kAfterDip = 6s;
  std::vector<Scenario> out;
  for (const std::size_t small : {kSmall, kTiny}) {
    Scenario s = base(choice, "dip", kCellMbit, kQueues[1]);
    s.name = "small-" + std::to_string(small / 1024) + "kib";
    s.message_bytes = kWhole;
    s.small_bytes = small;
    s.period = kCameraPeriod;
    s.load = static_cast<double>(s.capacity.transmit_time(ip_bytes_of(kWhole)).count()) /
             static_cast<double>(kCameraPeriod.count());
    s.dip = kDip;
    s.length = std::max(choice.length, kDip.at + kDip.length + kAfterDip);
    out.push_back(std::move(s));
  }
  return out;
}

std::vector<Scenario> fleet(const Choice& choice) {
  // Two and a half times what 200 vehicles offer.
  constexpr double kMbit = 200;
  constexpr std::size_t kVehicles = 200;
  constexpr std::size_t kBytes = 5000;
  Scenario s = base(choice, "fleet", kMbit, kQueues[1]);
  s.name = std::to_string(kVehicles) + "-vehicles";
  s.vehicles = kVehicles;
  s.deadline = kCameraPeriod;
  s.period = kCameraPeriod;
  s.message_bytes = kBytes;
  const Duration on_wire = s.capacity.transmit_time(ip_bytes_of(kBytes));
  s.load = static_cast<double>(on_wire.count() * std::int64_t{kVehicles}) /
           static_cast<double>(kCameraPeriod.count());
  return {s};
}

}  // namespace

std::span<const std::string_view> peer_names() { return kPeerNames; }

std::string_view name_of(Peer peer) { return kPeerNames[static_cast<std::size_t>(peer)]; }

std::optional<Peer> peer_of(std::string_view name) {
  const auto it = std::ranges::find(kPeerNames, name);
  if (it == kPeerNames.end()) return std::nullopt;
  return static_cast<Peer>(it - kPeerNames.begin());
}

std::span<const Peer> modelled_peers() { return kModelled; }
std::span<const Peer> real_peers() { return kReal; }

std::span<const Group> groups() { return kGroups; }

std::vector<std::size_t> variant_bytes(const Scenario& scenario) {
  if (scenario.peer != Peer::kOursVariants) return {scenario.message_bytes};
  return {scenario.message_bytes, scenario.small_bytes};
}

std::vector<Duration> joins(const Scenario& s) {
  std::vector<Duration> out(s.vehicles);
  if (!s.is_spread) return out;
  // A stream of its own: the phases of the vehicles are those of vehicles that join together.
  emu::RandomStream random(emu::split_mix(s.seed));
  for (std::size_t v = 1; v < s.vehicles; ++v) {
    const double apart = random.uniform() * static_cast<double>(kMostApart.count());
    out[v] = out[v - 1] + Duration{static_cast<std::int64_t>(apart)};
  }
  return out;
}

Duration span_of(const Scenario& s) {
  return s.length + (s.vehicles > 0 ? joins(s).back() : Duration{});
}

Duration joining_time(const Scenario& s) {
  if (!s.is_spread || s.vehicles < 2 || s.length <= kEarly) return {};
  return joins(s).back() + kEarly;
}

std::vector<Duration> first_messages(const Scenario& s) {
  emu::RandomStream random(s.seed);
  const std::vector<Duration> joined = joins(s);
  std::vector<Duration> out;
  for (std::size_t v = 0; v < s.vehicles; ++v) {
    const auto phase = random.uniform() * static_cast<double>(s.period.count());
    const bool is_late = s.late && v + 1 == s.vehicles;
    out.push_back(joined[v] + Duration{static_cast<std::int64_t>(phase)} +
                  (is_late ? *s.late : Duration{}));
  }
  return out;
}

std::size_t ip_bytes_of(std::size_t message_bytes) {
  const std::size_t pieces =
      std::max<std::size_t>(1, (message_bytes + kMaxPieceBytes - 1) / kMaxPieceBytes);
  return message_bytes + pieces * (kPieceOverheadBytes + kIpUdpBytes);
}

double payload_share(std::size_t message_bytes) {
  return static_cast<double>(message_bytes) / static_cast<double>(ip_bytes_of(message_bytes));
}

std::vector<Scenario> scenarios(std::string_view group, const Choice& choice) {
  using Family = std::vector<Scenario> (*)(const Choice&);
  constexpr std::array<Family, kGroups.size()> kFamilies{rate,  size, vehicles, late,
                                                         cubic, ecn,  dip,      fleet};
  const auto found = std::ranges::find(kGroups, group, &Group::name);
  if (found == kGroups.end()) return {};
  const std::vector<Scenario> family =
      kFamilies[static_cast<std::size_t>(found - kGroups.begin())](choice);
  std::vector<Peer> peers = choice.peers;
  if (peers.empty()) peers.assign(kModelled.begin(), kModelled.end());
  std::vector<Scenario> out;
  for (const Peer peer : peers) {
    for (Scenario s : family) {
      s.peer = peer;
      if (s.small_bytes == 0) s.small_bytes = s.message_bytes / kSmallerVariant;
      if (peer != Peer::kOursVariants) s.small_bytes = 0;
      // Without variants, those that differ by them alone are one.
      const bool is_twin = s.dip && s.small_bytes == 0 && !out.empty() && out.back().peer == peer;
      if (s.dip && s.small_bytes == 0) s.name = "no-variants";
      if (!is_twin) out.push_back(std::move(s));
    }
  }
  return out;
}

}  // namespace interneuron::load
