#include "lab/bench/reports.h"

#include <fmt/format.h>

#include <algorithm>

namespace interneuron::bench {
namespace {

using peers_testbed::Row;

records::Json known_value(const std::optional<double>& value) {
  return value ? records::Json(records::rounded(*value)) : records::Json(nullptr);
}

records::Json row_json(const Row& r) {
  return {{"scenario", r.scenario->name},
          {"peer", r.peer->name},
          {"message_bytes", r.message_bytes},
          {"period_ms", to_ms(r.period)},
          {"deadline_ms", to_ms(r.deadline)},
          {"messages", r.messages},
          {"missed", r.missed},
          {"degraded", r.degraded},
          {"wire_ratio", records::rounded(r.wire_ratio)},
          {"p50_ms", known_value(r.p50_ms)},
          {"p99_ms", known_value(r.p99_ms)},
          {"cpu_us_send", records::rounded(r.cpu_us_send)},
          {"cpu_us_receive", known_value(r.cpu_us_receive)},
          {"missed_numbers", r.missed_numbers},
          {"emulator_late_ms", records::rounded(r.emulator_late_ms)},
          {"seed", r.seed}};
}

std::string number(const std::optional<double>& value) {
  return value ? fmt::format("{:.1f}", *value) : "–";
}

// Messages without any variant in time, and in brackets those in a smaller one.
std::string misses(const Row& r) {
  return r.degraded > 0 ? fmt::format("{} ({})", r.missed, r.degraded)
                        : fmt::format("{}", r.missed);
}

// Those of one scenario and size.
using Table = std::vector<const Row*>;

std::vector<Table> tables_of(const std::vector<Row>& rows) {
  std::vector<Table> out;
  for (const Row& r : rows) {
    const bool is_next = out.empty() || out.back().back()->scenario != r.scenario ||
                         out.back().back()->message_bytes != r.message_bytes;
    if (is_next) out.emplace_back();
    out.back().push_back(&r);
  }
  return out;
}

std::vector<Duration> deadlines_of(const Table& table) {
  std::vector<Duration> out;
  for (const Row* r : table) {
    if (std::ranges::find(out, r->deadline) == out.end()) out.push_back(r->deadline);
  }
  return out;
}

void print_table(const Table& table) {
  const Row& any = *table.front();
  const std::vector<Duration> deadlines = deadlines_of(table);
  fmt::print("\n{}: {}\n{} messages of {} bytes, one every {:.0f} ms, seed {}\n",
             any.scenario->name, any.scenario->about, any.messages, any.message_bytes,
             to_ms(any.period), any.seed);
  fmt::print("{:<20}", "peer");
  for (const Duration d : deadlines) {
    fmt::print("{:>15}", fmt::format("missed {:.0f} ms", to_ms(d)));
  }
  fmt::print("{:>8}{:>9}{:>9}{:>12}{:>15}\n", "wire", "p50 ms", "p99 ms", "us to send",
             "us to receive");
  for (std::size_t i = 0; i < table.size(); i += deadlines.size()) {
    const Row& first = *table[i];
    fmt::print("{:<20}", first.peer->name);
    for (std::size_t d = 0; d < deadlines.size(); ++d) fmt::print("{:>15}", misses(*table[i + d]));
    fmt::print("{:>8.2f}{:>9}{:>9}{:>12.0f}{:>15}\n", first.wire_ratio, number(first.p50_ms),
               number(first.p99_ms), first.cpu_us_send,
               first.cpu_us_receive ? fmt::format("{:.0f}", *first.cpu_us_receive) : "–");
  }
}

}  // namespace

records::Json peers_json(const peers_testbed::Compared& compared, TransportKind datagrams) {
  records::Json out{{"schema", kPeersSchema},
                    {"transport", to_string(datagrams)},
                    {"rows", records::Json::array()},
                    {"skipped", records::Json::array()}};
  for (const Row& r : compared.rows) out["rows"].push_back(row_json(r));
  for (const peers_testbed::Skipped& s : compared.skipped) {
    out["skipped"].push_back({{"peer", s.peer}, {"reason", s.reason}});
  }
  return out;
}

void print_peers(const peers_testbed::Compared& compared, TransportKind datagrams) {
  for (const Table& table : tables_of(compared.rows)) print_table(table);
  fmt::print(
      "\nIn brackets: on time in a smaller variant. Wire: IP bytes that left the vehicle over "
      "those "
      "of whole messages.\nAges, bytes and processor time are those of the first deadline.\n");
  if (datagrams != TransportKind::kUdp) {
    fmt::print("What is ours used --transport {}.\n", to_string(datagrams));
  }
  for (const peers_testbed::Skipped& s : compared.skipped) {
    fmt::print("Left out: {}: {}\n", s.peer, s.reason);
  }
}

}  // namespace interneuron::bench
