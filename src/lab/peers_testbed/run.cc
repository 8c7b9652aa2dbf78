#include "lab/peers_testbed/comparison.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>

#include "app/process/signals.h"
#include "core/base/statistics.h"
#include "lab/transports/play.h"
#include "netns/testbed/testbed.h"
#include "node/io/steady_clock.h"

namespace interneuron::peers_testbed {
namespace {

namespace fs = std::filesystem;
using netns::Testbed;

constexpr std::array<const char*, kLinks> kModemNames{"a", "b"};

netns::TestbedOptions options_of(const Run& run, const fs::path& scratch) {
  netns::TestbedOptions out{.name = fmt::format("peers-{}", ::getpid()),
                            .backend = netns::Backend::kEmulator,
                            .runtime_dir = scratch};
  std::array<emu::LinkProfile, kLinks> profiles = run.scenario->links();
  std::vector<emu::ScenarioLink> links;
  for (std::size_t i = 0; i < kLinks; ++i) {
    links.push_back({kModemNames[i], std::move(profiles[i]), emu::link_seed(run.seed, i)});
  }
  out.scenario = emu::plain_scenario(std::move(links), run.seed);
  return out;
}

// What half a round trip over the first link takes in the median of this run, without any queue.
Duration way_of(const Run& run) {
  emu::DelayProcess process(run.scenario->links()[0].delay, emu::link_seed(run.seed, 0));
  std::vector<Duration> ways;
  for (Duration at{}; at <= run.length(); at += emu::kDelayStep) {
    ways.push_back(process.at(at).rtt / 2);
  }
  return percentile(std::move(ways), 0.5);
}

Duration longest_deadline(const Run& run) { return std::ranges::max(run.deadlines); }

transports::Order order_of(const Run& run, const netns::State& state, const fs::path& scratch) {
  transports::Order order{transport_of(run),
                          {variant_bytes(*run.peer, run.message_bytes),
                           longest_deadline(run),
                           run.period(),
                           run.length(),
                           {Duration{}}},
                          transports::modems_of(state),
                          scratch,
                          way_of(run)};
  if (!run.peer->all_modems) order.modems.resize(1);
  return order;
}

}  // namespace

transports::Transport transport_of(const Run& run) {
  return {run.peer->kind, std::string(run.peer->mode), run.datagrams};
}

Ran play_run(const Run& run, const fs::path& folder) {
  const transports::Scratch scratch(folder);
  const Testbed testbed = Testbed::up(options_of(run, folder));
  const auto hole = [&](TimePoint begin) {
    if (run.scenario->hole == Duration{}) return;
    process::SignalWatch::sleep(begin + run.length() / 2 - io::now());
    Testbed::outage(testbed.state(), kModemNames.front(), run.scenario->hole);
  };
  const transports::Played played =
      transports::play(testbed.state(), order_of(run, testbed.state(), folder), hole);
  Ran ran{rows_of(run, played.vehicles, played.road), played.doubt};
  for (Row& row : ran.rows) row.emulator_late_ms = played.after.lateness_max_us / 1e3;
  return ran;
}

Duration time_of_run(const Run& run) {
  return run.length() + longest_deadline(run) + transports::kRunOverhead;
}

}  // namespace interneuron::peers_testbed
