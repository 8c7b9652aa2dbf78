// What a message costs the sender to one peer, without packets being written: processor time per
// message of one piece with many outstanding, and the time of the one call that pulls a path with a
// large message in flight.
//
//   build/release/bench/sender_bench [--outstanding N ...] [--messages N]
//
// Outstanding messages are in flight over a path of 50 ms, or wait for a path whose window is full.
// Every message is sent, polled for, acknowledged by a report for every
// eighth, and each is followed by the time-outs that a peer looks at.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <deque>
#include <vector>

#include "bench/cpu_time.h"
#include "core/flow/arrivals.h"
#include "core/flow/sender.h"

namespace interneuron::bench {
namespace {

using namespace flow;
using namespace std::chrono_literals;

constexpr LinkId kA{0};
constexpr LinkId kB{1};
constexpr std::size_t kSmall = 500;
constexpr std::size_t kIpBytes = kSmall + kPieceOverheadBytes + kIpUdpBytes;
constexpr Duration kDeadline = 1s;

PathView fast() {
  PathView view;
  view.rate = DataRate::mbit(1000);
  view.pace = DataRate::mbit(1'000'000);
  view.one_way = 50ms;
  view.probe_timeout = 200ms;
  return view;
}

Sender sender() {
  Sender s({});
  for (const LinkId path : {kA, kB}) {
    s.add_path(path, kMaxDatagramBytes);
    s.set_path(path, fast());
  }
  return s;
}

double in_flight(std::size_t outstanding, std::size_t messages) {
  Sender s = sender();
  PathReceiver receiver(kA);
  TimePoint now{1s};
  const Duration gap = Duration{100ms} / outstanding;
  std::deque<std::uint64_t> flying;
  double begin = 0;
  for (std::size_t i = 0; i < outstanding + messages; ++i, now += gap) {
    if (i == outstanding) begin = thread_us();
    s.send(now, {.deadline = now + kDeadline, .lifetime = kDeadline}, Bytes(kSmall), {kA});
    while (const auto piece = s.poll(now, kA)) flying.push_back(piece->number);
    while (flying.size() > outstanding) {
      receiver.accept(now, flying.front(), flow::PathReceiver::Role::kData, kIpBytes);
      flying.pop_front();
      if (i % 8 == 0) s.report(now, receiver.report(now), 100ms);
      s.handle_timeout(now);
      (void)s.next_timeout();
    }
  }
  return (thread_us() - begin) / static_cast<double>(messages);
}

// The queue is as long when the time is taken as before: each message that comes ends another one.
double queued(std::size_t outstanding, std::size_t messages) {
  Sender s = sender();
  PathView full = fast();
  full.window = 0;
  s.set_path(kA, full);
  TimePoint now{1s};
  std::size_t bytes = 0;
  std::deque<MessageId> waiting;
  double begin = 0;
  for (std::size_t i = 0; i < outstanding + messages; ++i, now += 1us) {
    if (i == outstanding) begin = thread_us();
    bytes += s.queued_before(kA, now + kDeadline, kUsualImportance);
    waiting.push_back(
        s.send(now, {.deadline = now + kDeadline, .lifetime = kDeadline}, Bytes(kSmall), {kA}));
    (void)s.poll(now, kA);
    s.handle_timeout(now);
    (void)s.next_timeout();
    if (waiting.size() <= outstanding) continue;
    s.cancel(waiting.front());
    waiting.pop_front();
  }
  const double us = (thread_us() - begin) / static_cast<double>(messages);
  return bytes > 0 ? us : 0;
}

// A message of the largest size goes over both paths; then one of these is pulled.
double pull() {
  Sender s = sender();
  const TimePoint now{1s};
  s.send(now, {.deadline = now + 10s, .lifetime = 10s}, Bytes(kMaxMessageBytes), {kA, kB});
  for (TimePoint t = now; t < now + 200ms; t += 500us) {
    for (const LinkId path : {kA, kB}) {
      while (s.poll(t, path)) {
      }
    }
  }
  const double begin = thread_us();
  s.pull(now + 200ms, kA);
  return thread_us() - begin;
}

}  // namespace
}  // namespace interneuron::bench

int main(int argc, char** argv) {
  std::vector<std::size_t> outstanding{1, 10, 100, 1000, 3000};
  std::size_t messages = 4000;
  CLI::App app("What a message costs the sender to one peer.");
  app.add_option("--outstanding", outstanding, "Messages under way; a line for each number");
  app.add_option("--messages", messages, "Messages that are measured");
  CLI11_PARSE(app, argc, argv);
  for (const std::size_t n : outstanding) {
    fmt::print("{:5} outstanding: {:6.2f} µs a message in flight, {:6.2f} µs queued\n", n,
               interneuron::bench::in_flight(n, messages), interneuron::bench::queued(n, messages));
  }
  fmt::print("pulling a path with 8 MiB in flight: {:.0f} µs\n", interneuron::bench::pull());
  return 0;
}
