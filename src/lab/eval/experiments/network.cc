// table-network: the delays of 4G and 5G while driving (docs/paper.md, "Network table"), pinged in
// virtual time.
#include <fmt/format.h>

#include <cmath>

#include "core/base/statistics.h"
#include "lab/emu/link.h"
#include "lab/emu/profile.h"
#include "lab/eval/experiments/document.h"
#include "lab/eval/experiments/experiment.h"

namespace interneuron::experiments {
namespace {

// Bytes of IP, as `ping` sends by default.
constexpr std::size_t kPingBytes = 84;
constexpr Duration kPingPeriod = std::chrono::milliseconds(100);
// For the last answers: the longest delay of the profiles and some more.
constexpr Duration kTail = std::chrono::seconds(2);
// What the figure shows of the first drive.
constexpr Duration kShown = std::chrono::seconds(300);
// The figure shows every fifth ping.
constexpr std::size_t kShownEvery = 5;

// What the paper measured.
struct PaperNetwork {
  const char* profile;
  Moments rtt_ms;
};
constexpr PaperNetwork kPaper[] = {{"4g", {173, 23, 994, 258}}, {"5g", {26, 19, 96, 12}}};

struct Drive {
  // Round trips in ms, each with the instant at which its ping was sent.
  std::vector<std::pair<Duration, double>> rtt_ms;
  std::uint32_t lost = 0;
};

Drive drive(const emu::LinkProfile& profile, std::uint64_t seed, std::uint32_t pings) {
  emu::Link link(profile, emu::link_seed(seed, 0));
  Drive out;
  std::uint32_t sent = 0;
  for (Duration now{}; now < pings * kPingPeriod + kTail;) {
    Duration next = sent < pings ? sent * kPingPeriod : Duration::max();
    next = std::min(next, link.up().next_delivery().value_or(Duration::max()));
    next = std::min(next, link.down().next_delivery().value_or(Duration::max()));
    if (next == Duration::max()) break;
    now = next;
    while (const auto answer = link.down().dequeue(now)) {
      const Duration began = static_cast<std::int64_t>(answer->tag) * kPingPeriod;
      out.rtt_ms.emplace_back(began, to_ms(now - began));
    }
    while (const auto ping = link.up().dequeue(now)) {
      if (!link.down().enqueue(now, kPingBytes, ping->tag)) ++out.lost;
    }
    if (sent < pings && sent * kPingPeriod == now) {
      if (!link.up().enqueue(now, kPingBytes, sent)) ++out.lost;
      ++sent;
    }
  }
  return out;
}

std::optional<Moments> moments(const std::vector<double>& values) {
  if (values.empty()) return std::nullopt;
  const double average = mean(values);
  double squares = 0;
  for (const double v : values) squares += (v - average) * (v - average);
  const auto [min, max] = std::ranges::minmax(values);
  return Moments{average, min, max, std::sqrt(squares / static_cast<double>(values.size()))};
}

Series series_of(const std::string& name, const Drive& drive) {
  Series out{name, "ms", {}};
  for (std::size_t i = 0; i < drive.rtt_ms.size(); i += kShownEvery) {
    const auto& [at, rtt] = drive.rtt_ms[i];
    if (at <= kShown) out.points.push_back({to_ms(at) / 1e3, std::round(rtt * 100) / 100, {}});
  }
  return out;
}

}  // namespace

void run_table_network(const Request& request, Document& document) {
  std::vector<NetworkRow> rows;
  for (const PaperNetwork& paper : kPaper) {
    const emu::LinkProfile profile = *emu::built_in_profile(paper.profile);
    std::vector<Drive> drives(request.seeds());
    request.progress.for_each(
        fmt::format("table-network {}", paper.profile), drives.size(),
        [&](std::size_t i) { drives[i] = drive(profile, request.first_seed + i, request.rounds); });
    std::vector<double> all;
    std::vector<double> means;
    std::uint64_t lost = 0;
    for (const Drive& d : drives) {
      std::vector<double> own;
      for (const auto& [at, rtt] : d.rtt_ms) own.push_back(rtt);
      all.insert(all.end(), own.begin(), own.end());
      if (!own.empty()) means.push_back(moments(own)->avg);
      lost += d.lost;
    }
    const std::optional<Moments> of_drives = moments(means);
    rows.push_back({.name = paper.profile,
                    .seeds = {request.first_seed, request.last_seed},
                    .pings = all.size() + lost,
                    .lost = lost,
                    .rtt_ms = moments(all),
                    .drive_mean_sd_ms = of_drives ? std::optional(of_drives->std) : std::nullopt,
                    .paper_rtt_ms = paper.rtt_ms});
    document.series.push_back(series_of(paper.profile, drives.front()));
  }
  document.tables.push_back(
      {"network",
       "Delay while driving at 50 km/h (round trip), ours and the paper's",
       "Pings of 84 bytes every 100 ms over the emulated links 4g and 5g, all drives pooled.",
       {{"/name", "network"},
        {"/rtt_ms/avg", "avg, ms", 1},
        {"/paper_rtt_ms/avg", "paper", 0},
        {"/rtt_ms/min", "min, ms", 1},
        {"/paper_rtt_ms/min", "paper", 0},
        {"/rtt_ms/max", "max, ms", 1},
        {"/paper_rtt_ms/max", "paper", 0},
        {"/rtt_ms/std", "std, ms", 1},
        {"/paper_rtt_ms/std", "paper", 0},
        {"/drive_mean_sd_ms", "sd of the drives' means, ms", 1},
        {"/pings", "pings"},
        {"/lost", "lost"}},
       std::move(rows)});
  document.notes.push_back(
      "The profiles are models fitted to the paper's table, so the long run agrees by design; one "
      "drive differs much, and a lost ping has no delay.");
}

}  // namespace interneuron::experiments
