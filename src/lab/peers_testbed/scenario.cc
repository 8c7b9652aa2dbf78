#include "lab/peers_testbed/scenario.h"

#include <algorithm>

#include "interneuron/sizes.h"
#include "lab/emu/cell.h"

namespace interneuron::peers_testbed {
namespace {

using namespace std::chrono_literals;
using emu::LinkProfile;
using Links = std::array<LinkProfile, kLinks>;

// A 5G modem and a 4G one with a good connection. No measurement behind these values: a message of
// 128 KiB takes a third of a deadline of 100 ms over the first, and most of it over the second.
struct Modem {
  DataRate rate;
  Duration one_way;
};
constexpr std::array<Modem, kLinks> kModems{
    {{DataRate::mbit(60), 15ms}, {DataRate::mbit(20), 30ms}}};

// The smaller variant has a quarter of the bytes, as in `bench load`.
constexpr std::size_t kSmaller = 4;

// Messages take at most this share of the slower link.
constexpr double kMostLoad = 0.9;
constexpr std::array<Duration, 6> kPeriods{100ms, 200ms, 500ms, 1s, 2s, 5s};

void set_rate(LinkProfile& link, DataRate rate) {
  for (emu::DirectionParams* direction : {&link.up, &link.down}) {
    direction->rate = rate;
    direction->trace.reset();
    direction->queue_bytes = emu::queue_bytes_of(rate, emu::kDefaultQueueTime);
  }
}

Links clean() {
  Links out;
  for (std::size_t i = 0; i < kLinks; ++i) {
    out[i].name = i == 0 ? "fast" : "slow";
    out[i].delay = emu::constant_delay(to_ms(2 * kModems[i].one_way), 0);
    set_rate(out[i], kModems[i].rate);
  }
  return out;
}

// This share of all packets is lost, both ways.
constexpr double kLoss = 0.01;

Links loss() {
  Links out = clean();
  for (LinkProfile& link : out) link.up.loss = link.down.loss = kLoss;
  return out;
}

Links bursts() {
  // Packets that a burst takes in the mean.
  constexpr double kBurst = 8;
  emu::GilbertElliott chain{.r = 1 / kBurst};
  // The share of time in the bad state is p / (p + r).
  chain.p = chain.r * kLoss / (1 - kLoss);
  Links out = clean();
  for (LinkProfile& link : out) link.up.gilbert_elliott = link.down.gilbert_elliott = chain;
  return out;
}

// Built-in profiles are there and valid, which a test of theirs checks.
LinkProfile profile(std::string_view name) { return emu::built_in_profile(name).value(); }

Links drive_5g_4g() { return {profile("5g"), profile("4g")}; }

// Measured delays and outages, with the rates of the other scenarios: those of the profiles are
// assumed, too, and carry no message of 128 KiB within a deadline.
Links with_rates(Links links) {
  for (std::size_t i = 0; i < kLinks; ++i) set_rate(links[i], kModems[i].rate);
  return links;
}
Links drive_lte_town() {
  return with_rates({profile("lte-verizon-downtown"), profile("lte-sprint-downtown")});
}
Links drive_lte_highway() {
  return with_rates({profile("lte-verizon-highway"), profile("lte-sprint-highway")});
}

Links drive_rates() { return {profile("4g"), profile("generated-cellular")}; }

constexpr std::array kScenarios{
    Scenario{"clean", "60 Mbit/s, 15 ms one way, and 20 Mbit/s, 30 ms; queues of 300 ms", clean},
    Scenario{"loss", "the same, each link loses 1 % of all packets", loss},
    Scenario{"bursts", "the same, 1 % in bursts of 8 packets in the mean", bursts},
    Scenario{"hole", "as clean, but the first link carries nothing for 5 s in mid-run", clean, 5s},
    Scenario{"drive-5g-4g", "the profiles 5g and 4g: delays fitted to measured drives",
             drive_5g_4g},
    Scenario{"drive-lte-town", "round trips of two LTE networks, measured in one car in town",
             drive_lte_town},
    Scenario{"drive-lte-highway", "the same on highways", drive_lte_highway},
    Scenario{"drive-rates", "the profile 4g beside a modem whose rate changes all the time",
             drive_rates},
};

template <class T, class Range>
std::vector<T> or_all(const std::vector<T>& chosen, const Range& all) {
  return chosen.empty() ? std::vector<T>(std::begin(all), std::end(all)) : chosen;
}

template <class T>
std::vector<const T*> addresses(std::span<const T> all) {
  std::vector<const T*> out;
  for (const T& one : all) out.push_back(&one);
  return out;
}

std::size_t messages_of(const Choice& choice, std::size_t bytes) {
  if (!choice.length) return choice.messages;
  return static_cast<std::size_t>(std::max<std::int64_t>(1, *choice.length / period_of(bytes)));
}

// A run for each deadline, where that makes a difference to the peer; else one for all.
void add_by_deadline(const Run& run, std::vector<Run>& out) {
  if (!run.peer->heeds_deadline) {
    out.push_back(run);
    return;
  }
  for (const Duration deadline : run.deadlines) {
    out.push_back(run);
    out.back().deadlines = {deadline};
  }
}

}  // namespace

std::span<const Scenario> all_scenarios() { return kScenarios; }

const Scenario* scenario_of(std::string_view name) {
  const auto it = std::ranges::find(kScenarios, name, &Scenario::name);
  return it == kScenarios.end() ? nullptr : &*it;
}

Duration period_of(std::size_t message_bytes) {
  const std::size_t pieces = (message_bytes + kMaxPieceBytes - 1) / kMaxPieceBytes;
  const std::size_t ip_bytes = message_bytes + pieces * (kPieceOverheadBytes + kIpUdpBytes);
  const double least = to_ms(kModems.back().rate.transmit_time(ip_bytes)) / kMostLoad;
  for (const Duration period : kPeriods) {
    if (to_ms(period) >= least) return period;
  }
  return kPeriods.back();
}

std::vector<std::size_t> variant_bytes(const Peer& peer, std::size_t message_bytes) {
  if (!peer.variants) return {message_bytes};
  return {message_bytes, message_bytes / kSmaller};
}

std::vector<Run> runs_of(const Choice& choice) {
  const auto deadlines = or_all(choice.deadlines, kDeadlines);
  std::vector<Run> out;
  for (const Scenario* scenario : or_all(choice.scenarios, addresses(all_scenarios()))) {
    for (const std::size_t bytes : or_all(choice.sizes, kSizes)) {
      for (const Peer* peer : or_all(choice.peers, addresses(all_peers()))) {
        add_by_deadline({scenario, peer, bytes, messages_of(choice, bytes), deadlines, choice.seed},
                        out);
      }
    }
  }
  return out;
}

}  // namespace interneuron::peers_testbed
