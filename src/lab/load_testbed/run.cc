#include "lab/load_testbed/run.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>

#include "app/process/failure.h"
#include "app/process/signals.h"
#include "lab/load/bottleneck.h"
#include "lab/transports/play.h"
#include "netns/testbed/testbed.h"
#include "node/io/steady_clock.h"

namespace interneuron::load_testbed {
namespace {

namespace fs = std::filesystem;
using load::Peer;
using load::Scenario;
using netns::Testbed;

constexpr const char* kCell = "cell";
constexpr const char* kModems[] = {"a", "b"};

std::size_t modems_of(const Scenario& s) { return s.peer == Peer::kMptcp ? 2 : 1; }
const char* cross_control(const Scenario& s) { return s.is_cross_bbr ? "bbr" : "cubic"; }

// --- the testbed of a scenario

netns::TestbedOptions options_of(const Scenario& s, const fs::path& scratch) {
  netns::TestbedOptions out{.name = fmt::format("load-{}", ::getpid()),
                            .backend = netns::Backend::kEmulator,
                            .runtime_dir = scratch};
  const emu::LinkProfile modem = load::modem_of(s);
  emu::ScenarioCell cell;
  cell.name = kCell;
  // The testbed's time begins with the first packet, which is one of the meeting.
  cell.up = load::cell_of(s, load::kWarmUp);
  // The way back is never short.
  cell.down.rate = modem.down.rate;
  cell.down.queue_bytes = modem.down.queue_bytes;
  std::vector<emu::ScenarioLink> links;
  for (std::size_t i = 0; i < modems_of(s); ++i) {
    links.push_back({kModems[i], modem, emu::link_seed(s.seed, i), 0});
  }
  // Cross traffic has modems of its own, behind those of the transport.
  for (std::size_t i = 0; i < s.cross_flows; ++i) {
    links.push_back({fmt::format("x{}", i + 1), modem, emu::link_seed(s.seed, links.size()), 0});
  }
  out.scenario = emu::plain_scenario(std::move(links), s.seed);
  out.scenario.cells = {std::move(cell)};
  return out;
}

// --- what is played

transports::Transport transport_of(Peer peer) {
  switch (peer) {
    case Peer::kOurs:
      return {transports::Kind::kOurs, "best_link"};
    case Peer::kOursVariants:
      return {transports::Kind::kOurs, "down_sampling"};
    case Peer::kUdp:
      return {transports::Kind::kUdp, ""};
    case Peer::kTcpCubic:
      return {transports::Kind::kTcp, "cubic"};
    case Peer::kTcpBbr:
      return {transports::Kind::kTcp, "bbr"};
    case Peer::kMptcp:
      return {transports::Kind::kMptcp, "cubic"};
    default:
      break;
  }
  throw process::Failure(process::kFailed,
                         fmt::format("{} is for virtual time alone", load::name_of(peer)));
}

transports::Order order_of(const Scenario& s, const netns::State& state, const fs::path& scratch) {
  const std::vector<transports::Modem> all = transports::modems_of(state);
  const auto own = all.begin() + static_cast<std::ptrdiff_t>(modems_of(s));
  transports::Order order{transport_of(s.peer),
                          {load::variant_bytes(s), s.deadline, s.period, load::span_of(s),
                           load::first_messages(s), load::joins(s)},
                          {all.begin(), own},
                          scratch,
                          s.one_way};
  for (auto modem = own; modem != all.end(); ++modem) {
    order.cross.push_back({cross_control(s), *modem});
  }
  order.cross_lead = load::kCrossBegins;
  return order;
}

// --- figures

load::BottleneckPart part_of(const netns::Snapshot& snapshot, Duration length) {
  const netns::CellDirection& up = snapshot.cells.at(0).up;
  return {length, to_ms(up.queue_p99), up.utilisation};
}

// The scenario as it was played: the dip was at an instant of the testbed's time.
Scenario played_scenario(const Scenario& s, const transports::Played& played) {
  Scenario out = s;
  if (out.dip && played.after.epoch) {
    out.dip->at += *played.after.epoch + load::kWarmUp - played.begin;
  }
  return out;
}

load::Meter meter_of(const Scenario& s, const transports::VehiclesRecord& vehicles,
                     const transports::RoadRecord& road) {
  const std::vector<std::size_t> variants = load::variant_bytes(s);
  load::Meter meter(s.vehicles, s.deadline, variants);
  for (std::size_t v = 0; v < std::min(s.vehicles, vehicles.begun.size()); ++v) {
    for (const TimePoint at : vehicles.begun[v]) meter.begin(v, at.time_since_epoch());
  }
  for (const transports::Arrival& a : road.arrivals) {
    if (a.vehicle >= s.vehicles || a.variant >= variants.size()) continue;
    if (a.number >= meter.messages(a.vehicle).size()) continue;
    meter.arrived(a.vehicle, a.number, a.variant, a.at.time_since_epoch());
  }
  return meter;
}

}  // namespace

std::optional<std::string> lacks(Peer peer) {
  const auto reason = lacks(transport_of(peer));
  if (!reason) return std::nullopt;
  return std::string(load::name_of(peer)) + ": " + *reason;
}

std::optional<std::string> cannot_play(const Scenario& s) {
  if (s.cross_flows == 0) return std::nullopt;
  const auto reason = transports::lacks({transports::Kind::kTcp, cross_control(s)});
  if (!reason) return std::nullopt;
  return s.group + ": " + *reason;
}

Duration time_of_run(const Scenario& s) {
  return load::span_of(s) + s.deadline + transports::kRunOverhead;
}

TestbedRow run_on_testbed(const Scenario& s, TransportKind datagrams, const fs::path& folder) {
  const transports::Scratch scratch(folder);
  const Testbed testbed = Testbed::up(options_of(s, folder));
  transports::Order order = order_of(s, testbed.state(), folder);
  order.transport.datagrams = datagrams;
  const Duration joined = load::joining_time(s);
  std::optional<load::BottleneckPart> joining;
  const transports::Played played = play(testbed.state(), order, [&](TimePoint begin) {
    Testbed::measure_cells(testbed.state());
    if (joined == Duration{}) return;
    process::SignalWatch::sleep(begin + joined - io::now());
    joining = part_of(Testbed::snapshot(testbed.state()), joined);
    Testbed::measure_cells(testbed.state());
  });

  TestbedRow out{{}, played.doubt};
  const load::Meter meter = meter_of(s, played.vehicles, played.road);
  out.row.scenario = s;
  const Scenario was = played_scenario(s, played);
  if (was.dip && was.dip->at < Duration{}) out.doubt = "the rate fell before messages began";
  load::read_messages(was, meter, played.begin.time_since_epoch(), out.row);
  const std::uint64_t cross =
      played.cross.bytes_between(played.begin, played.begin + load::span_of(s));
  load::read_cross_traffic(s, meter, static_cast<double>(cross), out.row);
  load::read_bottleneck(joining, part_of(played.after, load::span_of(s) - joined), out.row);
  out.row.road_cpu_percent = 100 * played.road.cpu;
  return out;
}

}  // namespace interneuron::load_testbed
