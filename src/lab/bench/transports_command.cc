#include "lab/bench/command.h"

#include <fmt/format.h>

#include <memory>

#include "app/process/failure.h"
#include "app/process/signals.h"
#include "app/records/json_file.h"
#include "lab/transport_costs/costs.h"

namespace interneuron::bench {
namespace {

using transport_costs::Row;

constexpr const char* kTransportsSchema = "interneuron.transports/1";
// How long a run may be; a shorter one meets too few ticks of the processor's accounts.
constexpr double kLeastTransportSeconds = 0.1;
constexpr double kMostTransportSeconds = 60;

struct TransportsOptions {
  double seconds = 1;
  bool json = false;
};

double both(const Row& r) { return r.send_us + r.receive_us; }

// What it costs in terms of udp at the same load; 0: one of them could not be measured.
double ratio(const Row& row, const std::vector<Row>& rows) {
  for (const Row& r : rows) {
    const bool is_base = r.load == row.load && r.transport == TransportKind::kUdp;
    if (is_base && both(r) > 0) return both(row) / both(r);
  }
  return 0;
}

records::Json json_of(const std::vector<Row>& rows) {
  records::Json out{{"schema", kTransportsSchema}, {"rows", records::Json::array()}};
  for (const Row& r : rows) {
    const bool measured = r.failure.empty();
    const auto known = [measured](double v) {
      return measured ? records::Json(records::rounded(v)) : records::Json(nullptr);
    };
    out["rows"].push_back({{"load", r.load->name},
                           {"transport", to_string(r.transport)},
                           {"datagrams", r.sent},
                           {"lost", r.lost},
                           {"cpu_us_send", known(r.send_us)},
                           {"cpu_us_receive", known(r.receive_us)},
                           {"ratio_to_udp", known(ratio(r, rows))},
                           {"failure", r.failure}});
  }
  return out;
}

void print_table(const std::vector<Row>& rows) {
  const transport_costs::Load* load = nullptr;
  for (const Row& r : rows) {
    if (r.load != load) {
      load = r.load;
      fmt::print("\n{}: {}\n", load->name, load->about);
      fmt::print("{:10}{:>12}{:>8}{:>12}{:>15}{:>10}\n", "transport", "datagrams", "lost",
                 "us to send", "us to receive", "of udp");
    }
    if (!r.failure.empty()) {
      fmt::print("{:10}{}\n", to_string(r.transport), r.failure);
      continue;
    }
    fmt::print("{:10}{:>12}{:>8}{:>12.2f}{:>15.2f}{:>10.2f}\n", to_string(r.transport), r.sent,
               r.lost, r.send_us, r.receive_us, ratio(r, rows));
  }
  fmt::print(
      "\nProcessor time per datagram, median of {} runs, over a veth pair. --transport auto takes "
      "udp.\n",
      transport_costs::kRepetitions);
}

int run_transports(const TransportsOptions& o) {
  const process::SignalWatch signals;
  const auto rows =
      transport_costs::measure(from_ms(o.seconds * 1000), [&o](std::size_t done, std::size_t all) {
        const double left = static_cast<double>(all - done) * (o.seconds + 0.3);
        fmt::print(stderr, "bench transports: run {} of {}, {:.0f} s left\n", done + 1, all, left);
      });
  if (o.json) {
    fmt::print("{}\n", json_of(rows).dump(2));
  } else {
    print_table(rows);
  }
  return process::kFine;
}

}  // namespace

void add_transports(CLI::App& bench, std::function<int()>& run) {
  auto o = std::make_shared<TransportsOptions>();
  CLI::App* c = bench.add_subcommand(
      "transports", "Processor time of the transports that --transport offers, on this machine");
  c->add_option("--seconds", o->seconds, "Length of each run")
      ->capture_default_str()
      ->check(CLI::Range(kLeastTransportSeconds, kMostTransportSeconds));
  c->add_flag("--json", o->json, "The rows as JSON on stdout (docs/schema/transports.json)");
  c->footer(
      "In network namespaces of its own: root, or user namespaces (exit code 5).\n"
      "Examples:\n  interneuron bench transports\n  interneuron bench transports --seconds 5 "
      "--json");
  c->callback([&run, o] { run = [o] { return run_transports(*o); }; });
}

}  // namespace interneuron::bench
