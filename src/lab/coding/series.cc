#include "lab/coding/series.h"

#include <algorithm>
#include <optional>

#include "interneuron/policy.h"
#include "lab/emu/link.h"
#include "lab/sim/world.h"

namespace interneuron::coding {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr std::size_t kImage = 128 * 1024;
// Both ends know their links by then.
constexpr Duration kBegin = seconds(2);
// Of the emulated queues: far more than congestion control fills.
constexpr std::size_t kQueueBytes = 10'000'000;

emu::LinkProfile link(double rtt_ms, double mbit, double loss = 0) {
  emu::LinkProfile p;
  p.name = "constant";
  for (auto& state : p.delay.states) {
    state.level_ms = rtt_ms;
    state.loss = loss;
    // It never leaves its state.
    state.sojourn_mean_s = 1e6;
  }
  p.delay.min_ms = p.delay.max_ms = rtt_ms;
  p.up = p.down = {DataRate::mbit(mbit), kQueueBytes};
  return p;
}

std::vector<emu::LinkProfile> far_links(double loss) {
  return {link(78, 60, loss), link(78, 20, loss)};
}
std::vector<emu::LinkProfile> near_links(double loss) {
  return {link(30, 60, loss), link(60, 20, loss)};
}
// 1 % of the packets, in bursts of 8 in the mean.
std::vector<emu::LinkProfile> bursty_links() {
  constexpr double kShare = 0.01;
  constexpr double kEnds = 1.0 / 8;
  auto links = far_links(0);
  for (emu::LinkProfile& l : links) {
    l.up.gilbert_elliott = emu::GilbertElliott{.p = kEnds * kShare / (1 - kShare), .r = kEnds};
  }
  return links;
}

const std::vector<Series>& series() {
  static const std::vector<Series> all{
      {"losses",
       "60 and 20 Mbit/s, both 39 ms one way, 1 % of all packets lost",
       [] { return far_links(0.01); },
       milliseconds(130),
       milliseconds(100),
       {kImage},
       "coded",
       2000},
      {"bursts",
       "the same, 1 % in bursts of 8 packets in the mean, one way",
       bursty_links,
       milliseconds(130),
       milliseconds(100),
       {kImage},
       "coded",
       2000},
      {"clean",
       "60 Mbit/s, 15 ms one way, and 20 Mbit/s, 30 ms",
       [] { return near_links(0); },
       milliseconds(100),
       milliseconds(100),
       {kImage},
       "coded",
       2000},
      {"near",
       "the same, 1 % of all packets lost",
       [] { return near_links(0.01); },
       milliseconds(100),
       milliseconds(100),
       {kImage},
       "coded",
       2000},
      {"hole",
       "as clean, but the first link carries nothing for 5 s, at 40 phases",
       [] { return near_links(0); },
       milliseconds(100),
       milliseconds(100),
       {kImage, kImage / 4},
       "shadow",
       100,
       40,
       seconds(5)},
      {"halves",
       "384 KiB over two links of 20 Mbit/s, 15 and 25 ms one way",
       [] {
         return std::vector{link(30, 20), link(50, 20)};
       },
       milliseconds(130),
       milliseconds(125),
       {384 * 1024},
       "stripe",
       2000},
  };
  return all;
}

// One phase of a series.
class Phase {
 public:
  Phase(const Series& series, std::string_view policy, std::size_t messages, std::uint64_t seed)
      : series_(series), policy_(policy), world_(seed), got_(messages) {
    EndpointOptions options;
    options.policies = builtin_policies();
    options.session = SessionId{1};
    vehicle_ = world_.add_host(options);
    options.session = SessionId{2};
    options.accept_peers = true;
    road_ = world_.add_host(options);
    const auto profiles = series.links();
    links_ = profiles.size();
    for (std::size_t i = 0; i < links_; ++i) {
      world_.add_link(vehicle_, road_, id(i), profiles[i].name,
                      emu::Link(profiles[i], emu::link_seed(seed, i)));
    }
    world_.on_event([this](sim::HostId host, Event&& event) {
      const auto* message = std::get_if<Message>(&event);
      if (message != nullptr && host == road_)
        got_.at(number_of(message->bytes)) = message->variant;
    });
    peer_ = world_.connect(vehicle_, road_);
  }

  void run(Duration hole_begins, Row& row) {
    const auto count = static_cast<std::int64_t>(got_.size());
    for (std::int64_t i = 0; i < count; ++i) {
      world_.at(kBegin + i * series_.period, [this, i] { send(static_cast<std::size_t>(i)); });
    }
    if (series_.hole > Duration::zero()) {
      world_.outage(world_.wire_of(id(0)), hole_begins, series_.hole);
    }
    world_.run_until(kBegin - Duration{1});
    const std::uint64_t before = wire_bytes();
    world_.run_until(kBegin + count * series_.period + series_.deadline);
    bytes_ = wire_bytes() - before;
    const auto missed = std::ranges::count_if(got_, [](const auto& v) { return !v; });
    const auto degraded = std::ranges::count_if(got_, [](const auto& v) { return v && *v > 0; });
    row.messages += got_.size();
    row.missed += static_cast<std::size_t>(missed);
    row.degraded += static_cast<std::size_t>(degraded);
    row.most_degraded = std::max(row.most_degraded, static_cast<std::size_t>(degraded));
  }
  std::uint64_t bytes() const { return bytes_; }

 private:
  static LinkId id(std::size_t link) { return LinkId{static_cast<std::uint8_t>(link)}; }
  // A message begins with its number.
  static std::size_t number_of(const Bytes& bytes) {
    std::size_t number = 0;
    for (std::size_t i = 0; i < 4; ++i) {
      number |= std::to_integer<std::size_t>(bytes[i]) << (8 * i);
    }
    return number;
  }
  void send(std::size_t number) {
    Variants variants;
    for (const std::size_t size : series_.variants) {
      Bytes& bytes = variants.emplace_back(size);
      for (std::size_t i = 0; i < 4; ++i) bytes[i] = static_cast<std::byte>(number >> (8 * i));
    }
    SendOptions options;
    options.policy = policy_;
    options.deadline = series_.deadline;
    world_.endpoint(vehicle_).send(world_.local_time(vehicle_), peer_, std::move(variants),
                                   options);
    world_.flush(vehicle_);
  }
  std::uint64_t wire_bytes() const {
    std::uint64_t sum = 0;
    for (std::size_t i = 0; i < links_; ++i) sum += world_.stats(id(i), true).bytes_in;
    return sum;
  }

  const Series& series_;
  std::string policy_;
  sim::World world_;
  // The variant of each message that was delivered in time.
  std::vector<std::optional<std::uint8_t>> got_;
  sim::HostId vehicle_ = 0;
  sim::HostId road_ = 0;
  PeerId peer_{};
  std::size_t links_ = 0;
  std::uint64_t bytes_ = 0;
};

}  // namespace

std::span<const Series> all_series() { return series(); }

const Series* series_of(std::string_view name) {
  const auto it = std::ranges::find(series(), name, &Series::name);
  return it == series().end() ? nullptr : &*it;
}

Row run(const Series& series, std::string_view policy, std::size_t messages, std::uint64_t seed) {
  Row row{.series = &series, .policy = std::string(policy)};
  std::uint64_t bytes = 0;
  for (int phase = 0; phase < series.phases; ++phase) {
    Phase one(series, policy, messages, seed + static_cast<std::uint64_t>(phase));
    one.run(kBegin + seconds(2) + phase * series.period / series.phases, row);
    bytes += one.bytes();
  }
  row.wire_ratio =
      static_cast<double>(bytes) / static_cast<double>(row.messages * series.variants.front());
  return row;
}

}  // namespace interneuron::coding
