#include "netns/verify/session.h"

#include <fmt/format.h>
#include <signal.h>

#include <algorithm>
#include <utility>

#include "app/process/failure.h"
#include "app/process/signals.h"
#include "interneuron/sizes.h"
#include "netns/testbed/testbed.h"
#include "netns/verify/tools.h"
#include "node/io/steady_clock.h"

namespace interneuron::netns::verify {

namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

// A flow of iperf3 that runs, on the link at position `slot` of SessionOptions::links.
struct Running {
  IperfFlow flow;
  std::size_t slot = 0;
  Process server;
  Process client;

  // Ends the sender first; otherwise it would report an error as its peer has gone.
  void end() {
    Process& sender = flow.direction == Direction::kUp ? client : server;
    sender.end(SIGTERM);
    client.end(SIGTERM);
    server.end(SIGTERM);
  }
};

// One run of verify: starts and ends the tools and collects their output as evidence. All times
// that leave it are since the epoch of the links. A `slot` is a position in SessionOptions::links.
// Its processes and its temporary folder end with it, also when an exception is thrown.
class Session {
 public:
  Session(const State& state, const SessionOptions& options,
          const std::function<void(Duration)>& progress)
      : state_(state),
        options_(options),
        progress_(progress),
        wall_offset_(io::wall_offset()),
        started_(monotonic()),
        evidence_(options.links.size()) {}

  std::vector<LinkEvidence> run() {
    start_time();
    measure_rates(Direction::kUp);
    measure_rates(Direction::kDown);
    for (const Direction d : {Direction::kUp, Direction::kDown}) {
      measure_wakes(
          state_, options_, d, folder_, [this](Duration time) { wait(time); }, evidence_);
    }
    measure_window();
    const Duration step = io::wall_offset() - wall_offset_;
    if (step > kClockStep || step < -kClockStep) {
      throw process::Failure(process::kFailed,
                             "the clock was set while verify measured; run it again");
    }
    return std::move(evidence_);
  }

 private:
  using Flows = std::vector<Running>;

  struct Captures {
    Process vehicle;
    Process road;
  };

  const TestbedLink& link(std::size_t slot) const { return state_.links[options_.links[slot]]; }
  DirectionEvidence& direction(std::size_t slot, Direction d) {
    return evidence_[slot].directions[static_cast<std::size_t>(d)];
  }
  Duration elapsed() const { return monotonic() - started_; }

  void wait(Duration length) {
    constexpr Duration kSlice = milliseconds(200);
    const Duration until = elapsed() + length;
    for (Duration left = length; left > Duration{}; left = until - elapsed()) {
      process::SignalWatch::sleep(std::min(left, kSlice));
      progress_(elapsed());
    }
  }

  Process start(Host host, const std::vector<std::string>& argv, const std::string& name) {
    return {state_, host, argv, folder_, name};
  }

  // Starts tcpdump and returns at once; it may miss packets sent before await_start() has returned.
  Process capture(Host host, const TestbedLink& where, const std::vector<std::uint16_t>& ports,
                  bool both_ways) {
    return start(host, tcpdump(where.nic, ports, both_ways), fmt::format("tcpdump{}", ++names_));
  }
  static void await_start(const Process& process, const char* program) {
    if (await_text(process, "listening", kToolStart)) return;
    throw process::Failure(process::kFailed,
                           fmt::format("{} does not start: {}", program, process.last_words()));
  }

  std::vector<Datagram> finish(Process& process, std::uint64_t& drops);
  Schedule schedule(std::size_t slot, Duration from) const;
  Flows start_flows(const std::vector<std::pair<std::size_t, IperfFlow>>& wanted, Duration length);
  void await_traffic(Flows& flows, const Snapshot& before);
  std::string failure_of(const Running& running, const Snapshot& before) const;

  void start_time();
  void measure_rates(Direction d);
  void measure_batch(Direction d, const std::vector<std::size_t>& slots);
  void measure_window();
  Flows start_window_flows(Duration length);
  void collect_window(std::size_t slot, Captures& captures, const PingLog& pings);

  const State& state_;
  const SessionOptions& options_;
  const std::function<void(Duration)>& progress_;
  process::PrivateFolder folder_{"interneuron-verify"};
  Duration wall_offset_;
  Duration started_;
  int names_ = 0;
  // When the links' time began, in CLOCK_MONOTONIC. finish() reads it from the testbed.
  Duration epoch_{};
  std::vector<LinkEvidence> evidence_;
};

// Ends tcpdump and reads what it captured, with times since the epoch of the links. Adds to `drops`
// what tcpdump missed.
std::vector<Datagram> Session::finish(Process& process, std::uint64_t& drops) {
  process.end(SIGINT);
  auto records = parse_capture(process.output());
  if (!records) throw process::Failure(process::kFailed, "tcpdump failed: " + process.last_words());
  drops += parse_capture_drops(process.errors()).value_or(0);
  const auto epoch = Testbed::snapshot(state_).epoch;
  epoch_ = epoch ? epoch->time_since_epoch() : Duration{};
  for (Datagram& record : *records) {
    record.seen -= wall_offset_ + epoch_;
    record.stamp -= epoch_;
  }
  return std::move(*records);
}

// The schedule of a link from kLookBack before `from` (of CLOCK_MONOTONIC) until now.
Schedule Session::schedule(std::size_t slot, Duration from) const {
  return Schedule(Testbed::schedule(state_, options_.links[slot],
                                    std::max(Duration{}, from - epoch_ - kLookBack),
                                    monotonic() - epoch_));
}

// Starts the servers of all flows at once and then their clients, as starting one program after the
// other takes seconds on a busy machine.
Session::Flows Session::start_flows(const std::vector<std::pair<std::size_t, IperfFlow>>& wanted,
                                    Duration length) {
  // Clients are ended from here; the bound only ends those that this process leaves when it dies.
  const auto bound = static_cast<int>(length / seconds(1)) + 60;
  std::vector<Process> servers;
  for (const auto& [slot, flow] : wanted) {
    servers.push_back(start(kRoad, iperf_server(flow), fmt::format("iperf3-server{}", ++names_)));
  }
  Flows flows;
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    const auto& [slot, flow] = wanted[i];
    await_start(servers[i], "iperf3");
    flows.push_back({flow, slot, std::move(servers[i]),
                     start(vehicle_of(flow.link), iperf_client(flow, bound),
                           fmt::format("iperf3-client{}", ++names_))});
  }
  return flows;
}

// Waits until all flows have packets on their links. iperf3 agrees with its peer by one datagram
// each way and waits for ever when either is lost, so a flow that stays silent is started anew. A
// flow without packets after kIperfStart is left as it is; failure_of() then says why.
void Session::await_traffic(Flows& flows, const Snapshot& before) {
  const Duration bound = elapsed() + kIperfStart;
  const Duration patience = kIperfPatience + 20 * longest_delay(state_, options_.links);
  Duration retry = elapsed() + patience;
  while (elapsed() < bound) {
    bool all = true;
    const bool again = elapsed() > retry;
    for (Running& running : flows) {
      if (failure_of(running, before).empty()) continue;
      all = false;
      if (!again) continue;
      running.end();
      running = std::move(start_flows({{running.slot, running.flow}}, kIperfStart).front());
    }
    if (all) return;
    if (again) retry = elapsed() + patience;
    wait(milliseconds(100));
  }
}

// Why a flow has not sent; empty once it has sent kFlowingPackets since `before`.
std::string Session::failure_of(const Running& running, const Snapshot& before) const {
  const Snapshot now = Testbed::snapshot(state_);
  const std::size_t index = options_.links[running.slot];
  const Direction d = running.flow.direction;
  if (counters(now, index, d).packets_in >= counters(before, index, d).packets_in + kFlowingPackets)
    return "";
  const std::string words = running.client.last_words();
  return words.starts_with("iperf3: ") ? words : "iperf3 could not connect in time";
}

// Sends the first packet and waits until the links' time has begun with it: before that there is
// no schedule.
void Session::start_time() {
  const Process first = start(vehicle_of(link(0)), ping(link(0)), "first");
  const Duration bound = elapsed() + kToolStart;
  while (longest_delay(state_, options_.links) == Duration{}) {
    if (elapsed() > bound) {
      throw process::Failure(process::kFailed,
                             "no packet gets onto the links; ping says: " + first.last_words());
    }
    wait(milliseconds(50));
  }
}

// Saturates direction `d` of all links, as many at once as the machine can carry.
void Session::measure_rates(Direction d) {
  std::vector<std::size_t> batch;
  double sum = 0;
  for (std::size_t slot = 0; slot < evidence_.size(); ++slot) {
    const double mbit = present_mbit(state_, options_.links[slot], d);
    if (mbit > kMostMbit) {
      direction(slot, d).rate.not_measured = fmt::format("more than {} Mbit/s", kMostMbit);
      continue;
    }
    if (const std::string why = obstacle(link(slot)); !why.empty()) {
      direction(slot, d).not_measured = direction(slot, d).rate.not_measured = why;
      continue;
    }
    if (mbit <= 0) {
      direction(slot, d).rate.not_measured = "nothing passes";
      continue;
    }
    if (!batch.empty() && sum + mbit * kOffered > kMostAtOnceMbit) {
      measure_batch(d, std::exchange(batch, {}));
      sum = 0;
    }
    batch.push_back(slot);
    sum += mbit * kOffered;
  }
  if (!batch.empty()) measure_batch(d, batch);
}

// Saturates direction `d` of these links at the same time and captures what comes out of them.
void Session::measure_batch(Direction d, const std::vector<std::size_t>& slots) {
  const Duration begin = monotonic();
  const Snapshot before = Testbed::snapshot(state_);
  std::vector<Process> captures;
  std::vector<std::pair<std::size_t, IperfFlow>> wanted;
  for (const std::size_t slot : slots) {
    IperfFlow flow{link(slot), d, port_of(kFirstRatePort, slot, d), kRatePayload, 0};
    flow.payload_bits_per_second = present_mbit(state_, options_.links[slot], d) * 1e6 * kOffered *
                                   kRatePayload / (kRatePayload + kIpv4UdpBytes);
    captures.push_back(capture(receiver_of(flow.link, d), flow.link, {flow.port}, false));
    wanted.emplace_back(slot, flow);
  }
  for (const Process& process : captures) await_start(process, "tcpdump");
  Flows flows = start_flows(wanted, kRateTime);
  await_traffic(flows, before);
  wait(kRateTime);
  for (std::size_t i = 0; i < flows.size(); ++i) {
    direction(slots[i], d).rate.failure = failure_of(flows[i], before);
    flows[i].end();
  }
  // The bottleneck's queue drains, so that the next measurement finds it idle.
  wait(milliseconds(500) + std::min(longest_delay(state_, options_.links), kLongestDrain));
  const std::uint64_t kernel_drops = Testbed::snapshot(state_).kernel_drops - before.kernel_drops;
  for (std::size_t i = 0; i < flows.size(); ++i) {
    RateRun& run = direction(slots[i], d).rate;
    run.kernel_drops = kernel_drops;
    run.received = finish(captures[i], run.capture_drops);
    run.schedule = schedule(slots[i], begin);
    run.carrier = Testbed::carrier(state_, options_.links[slots[i]], d);
  }
}

// Starts a flow of small packets over each direction of each link, for a window of `length`.
Session::Flows Session::start_window_flows(Duration length) {
  std::vector<std::pair<std::size_t, IperfFlow>> flows;
  const double wanted = kWantedPackets / to_seconds(length);
  for (std::size_t slot = 0; slot < evidence_.size(); ++slot) {
    if (!direction(slot, Direction::kUp).not_measured.empty()) continue;
    for (const Direction d : {Direction::kUp, Direction::kDown}) {
      IperfFlow flow{link(slot), d, port_of(kFirstPort, slot, d), kSmallPayload, 0};
      const double most = kSmallShare * lasting_mbit(state_, options_.links[slot], d) * 1e6 / 8 /
                          static_cast<double>(kSmallPayload + kIpv4UdpBytes);
      const bool bursty = asked_of(flow.link, d, {}, 0).gilbert_elliott.has_value();
      const double per_second =
          std::max(1.0, std::min(std::clamp(bursty ? kBurstyFactor * wanted : wanted,
                                            kFewestPerSecond, kMostPerSecond),
                                 most));
      flow.payload_bits_per_second = per_second * kSmallPayload * 8;
      flows.emplace_back(slot, flow);
    }
  }
  return start_flows(flows, length);
}

// The second part: flows and pings over all links until the time is up. Counters are read before
// the flows (idle), at both ends of the window (before, end), and after packets in flight have
// arrived (after).
void Session::measure_window() {
  std::vector<Captures> captures;
  for (std::size_t slot = 0; slot < evidence_.size(); ++slot) {
    const std::vector<std::uint16_t> ports{port_of(kFirstPort, slot, Direction::kUp),
                                           port_of(kFirstPort, slot, Direction::kDown)};
    captures.push_back({capture(vehicle_of(link(slot)), link(slot), ports, true),
                        capture(kRoad, link(slot), ports, true)});
  }
  for (const Captures& both : captures) {
    await_start(both.vehicle, "tcpdump");
    await_start(both.road, "tcpdump");
  }
  const Snapshot idle = Testbed::snapshot(state_);
  const Duration drain =
      kCaptureFlush + std::min(longest_delay(state_, options_.links), kLongestDrain);
  const auto left = [&] { return std::max(kShortestWindow, options_.length - drain - elapsed()); };
  Flows flows = start_window_flows(left() - seconds(1));
  await_traffic(flows, idle);
  std::vector<Process> pings;
  for (std::size_t slot = 0; slot < evidence_.size(); ++slot) {
    pings.push_back(start(vehicle_of(link(slot)), ping(link(slot)), fmt::format("ping{}", slot)));
  }
  wait(kEdge);
  const Snapshot before = Testbed::snapshot(state_);
  const Duration from = monotonic();
  wait(left());
  const Snapshot end = Testbed::snapshot(state_);
  const Duration to = monotonic();
  wait(kEdge);
  for (const Running& running : flows) {
    direction(running.slot, running.flow.direction).failure = failure_of(running, idle);
  }
  for (Process& process : pings) process.end(SIGINT);
  for (Running& running : flows) running.end();
  wait(kCaptureFlush + std::min(longest_delay(state_, options_.links), kLongestDrain));
  const Snapshot after = Testbed::snapshot(state_);
  for (std::size_t slot = 0; slot < evidence_.size(); ++slot) {
    LinkEvidence& e = evidence_[slot];
    e.disturbance = disturbance(before, after);
    for (const Direction d : {Direction::kUp, Direction::kDown}) {
      const std::size_t index = options_.links[slot];
      direction(slot, d).counted = difference(counters(before, index, d), counters(end, index, d));
      direction(slot, d).asked =
          asked_of(link(slot), d, direction(slot, d).counted, kSmallPayload + kIpv4UdpBytes);
      direction(slot, d).asked.carrier = Testbed::carrier(state_, index, d);
    }
    collect_window(slot, captures[slot], parse_ping(pings[slot].output()));
    e.from = from - epoch_;
    e.to = to - epoch_;
    e.schedule = schedule(slot, from);
    for (DirectionEvidence& d : e.directions) d.flow = trim(std::move(d.flow), e.from, e.to);
  }
}

// Matches what tcpdump saw at both ends of one link, and moves pings to the time of the links.
void Session::collect_window(std::size_t slot, Captures& captures, const PingLog& pings) {
  LinkEvidence& e = evidence_[slot];
  const std::vector<Datagram> vehicle = finish(captures.vehicle, e.capture_drops);
  const std::vector<Datagram> road = finish(captures.road, e.capture_drops);
  const SentBy sent_by = state_.backend == Backend::kNetem ? SentBy::kStamp : SentBy::kCapture;
  for (const Direction d : {Direction::kUp, Direction::kDown}) {
    const std::uint16_t port = port_of(kFirstPort, slot, d);
    const auto own = [&](const std::vector<Datagram>& records) {
      std::vector<Datagram> out;
      std::copy_if(records.begin(), records.end(), std::back_inserter(out), [&](const Datagram& r) {
        return (d == Direction::kUp ? r.to_port : r.from_port) == port;
      });
      return out;
    };
    const bool up = d == Direction::kUp;
    direction(slot, d).flow = match(own(up ? vehicle : road), own(up ? road : vehicle), sent_by);
  }
  e.pings = pings;
  e.ping_ip_bytes = kPingIpBytes;
  for (Ping& ping : e.pings.answered) ping.sent -= wall_offset_ + epoch_;
}

}  // namespace

std::vector<LinkEvidence> measure(const State& state, const SessionOptions& options,
                                  const std::function<void(Duration)>& progress) {
  return Session(state, options, progress).run();
}

}  // namespace interneuron::netns::verify
