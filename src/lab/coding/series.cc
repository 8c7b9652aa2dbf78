#include "lab/coding/series.h"

#include <algorithm>

#include "lab/sim/duo.h"

namespace interneuron::coding {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr std::size_t kImage = 128 * 1024;
emu::LinkProfile link(double rtt_ms, double mbit, double loss = 0) {
  return emu::constant_link("constant", rtt_ms, mbit, mbit, loss);
}

std::vector<emu::LinkProfile> far_links(double loss) {
  return {link(78, 60, loss), link(78, 20, loss)};
}
std::vector<emu::LinkProfile> near_links(double loss) {
  return {link(30, 60, loss), link(60, 20, loss)};
}
// 1 % of the packets, in bursts of 8: in the mean, or exactly.
std::vector<emu::LinkProfile> bursty_links(bool exactly) {
  constexpr double kShare = 0.01;
  constexpr std::uint32_t kPackets = 8;
  constexpr double kEnds = 1.0 / kPackets;
  auto links = far_links(0);
  for (emu::LinkProfile& l : links) {
    l.up.gilbert_elliott = emu::GilbertElliott{
        .p = kEnds * kShare / (1 - kShare), .r = kEnds, .exactly = exactly ? kPackets : 0};
  }
  return links;
}

// Most of them: images at 10 Hz, as long as nothing else is said.
Series images(std::string_view name, std::string_view about,
              std::vector<emu::LinkProfile> (*links)(), Duration deadline) {
  return {name, about, links, deadline, milliseconds(100), {kImage}, "coded", 2000};
}

Series hole() {
  Series out = images(
      "hole", "as clean, but the first link carries nothing for 5 s, at 40 phases",
      [] { return near_links(0); }, milliseconds(100));
  out.variants.push_back(kImage / 4);
  out.policy = "shadow";
  out.messages = 100;
  out.phases = 40;
  out.hole = seconds(5);
  return out;
}

Series halves() {
  Series out = images(
      "halves", "384 KiB over two links of 20 Mbit/s, 15 and 25 ms one way",
      [] {
        return std::vector{link(30, 20), link(50, 20)};
      },
      milliseconds(130));
  out.period = milliseconds(125);
  out.variants = {384 * 1024};
  out.policy = "stripe";
  return out;
}

const std::vector<Series>& series() {
  static const std::vector<Series> all{
      images(
          "losses", "60 and 20 Mbit/s, both 39 ms one way, 1 % of all packets lost",
          [] { return far_links(0.01); }, milliseconds(130)),
      images(
          "bursts", "the same, 1 % in bursts of 8 packets in the mean, one way",
          [] { return bursty_links(false); }, milliseconds(130)),
      images(
          "eights", "the same, 1 % in bursts of exactly 8 packets, one way",
          [] { return bursty_links(true); }, milliseconds(130)),
      images(
          "clean", "60 Mbit/s, 15 ms one way, and 20 Mbit/s, 30 ms", [] { return near_links(0); },
          milliseconds(100)),
      images(
          "near", "the same, 1 % of all packets lost", [] { return near_links(0.01); },
          milliseconds(100)),
      hole(),
      halves(),
  };
  return all;
}

}  // namespace

std::span<const Series> all_series() { return series(); }

const Series* series_of(std::string_view name) {
  const auto it = std::ranges::find(series(), name, &Series::name);
  return it == series().end() ? nullptr : &*it;
}

Row run(const Series& series, std::string_view policy, std::size_t messages, std::uint64_t seed) {
  Row row{.series = &series, .policy = std::string(policy)};
  sim::Duo::Options options{.policy = row.policy,
                            .variants = series.variants,
                            .deadline = series.deadline,
                            .period = series.period,
                            .seed = seed};
  std::uint64_t bytes = 0;
  for (int phase = 0; phase < series.phases; ++phase, ++options.seed) {
    sim::Duo one(series.links(), options);
    if (series.hole > Duration::zero()) {
      one.world.outage(one.world.wire_of(LinkId{0}),
                       sim::Duo::kBegin + seconds(2) + phase * series.period / series.phases,
                       series.hole);
    }
    one.send(sim::Duo::kBegin, messages);
    bytes += one.run_counting();
    row.messages += messages;
    row.missed += one.missed();
    row.degraded += one.degraded();
    row.most_degraded = std::max(row.most_degraded, one.degraded());
  }
  row.wire_ratio =
      static_cast<double>(bytes) / static_cast<double>(row.messages * series.variants.front());
  return row;
}

}  // namespace interneuron::coding
