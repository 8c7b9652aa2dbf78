#include <memory>

#include "app/cli/commands.h"
#include "app/cli/probe.h"
#include "app/process/failure.h"

namespace interneuron::cli {
namespace {

// Packets closer than this are a flood, and would measure what this host's own scheduling adds.
constexpr double kMinIntervalMs = 1;
constexpr double kMaxIntervalMs = 60'000;
constexpr double kMaxTimeoutMs = 60'000;

}  // namespace

void add_probe(CLI::App& program, std::function<int()>& run) {
  auto o = std::make_shared<ProbeOptions>();
  auto stamp = std::make_shared<std::uint16_t>(0);
  CLI::App* c = program.add_subcommand(
      "probe", "Measure the paths to a roadside unit over every NIC: round trip, loss, rate");
  c->add_option("--peer", o->peer,
                "HOST[:PORT] to measure to; port 47000 by default, with --stamp its port");
  c->add_option("--nic", o->nics,
                "NIC[=HOST[:PORT]], a name, glob, kind:KIND or mac:ADDRESS; once per NIC (default: "
                "every NIC that is ready)")
      ->take_all();
  c->add_option("--count", o->count, "Packets per NIC; 0: until Ctrl-C")
      ->capture_default_str()
      ->check(CLI::Range(std::size_t{0}, probe::kMaxPings));
  c->add_option("--interval", o->interval_ms, "Between two packets, like 20ms or 0.5s, from 1ms on")
      ->default_str("20ms")
      ->transform(CLI::AsNumberWithUnit(std::map<std::string, double>{{"ms", 1}, {"s", 1e3}},
                                        CLI::AsNumberWithUnit::CASE_INSENSITIVE, "TIME"))
      ->check(CLI::Range(kMinIntervalMs, kMaxIntervalMs));
  c->add_option("--timeout", o->timeout_ms, "A later reply is late, like 1s or 500ms")
      ->default_str("1s")
      ->transform(CLI::AsNumberWithUnit(std::map<std::string, double>{{"ms", 1}, {"s", 1e3}},
                                        CLI::AsNumberWithUnit::CASE_INSENSITIVE, "TIME"))
      ->check(CLI::Range(1.0, kMaxTimeoutMs));
  c->add_option("--size", o->size, "UDP payload, bytes")
      ->capture_default_str()
      ->check(CLI::Range(probe::smallest(probe::Format::kEcho), kMaxDatagramBytes));
  c->add_flag("--no-rate", o->no_rate, "No trains for the rate");
  CLI::Option* stamp_option =
      c->add_option("--stamp", *stamp, "Plain STAMP (RFC 8762) to any reflector, port 862 or PORT")
          ->expected(0, 1)
          ->default_str(std::to_string(wire::kStampPort))
          ->check(CLI::Range(1, 65535))
          ->type_name("[PORT]");
  settings::add_key_options(*c, o->keys, settings::Trusts::kThePeer);
  c->add_flag("--json", o->json, "The summary as JSON");
  c->add_flag("--json-stream", o->json_stream,
              "One JSON object per reply and line, the summary as the last");
  c->footer(
      "Examples:\n  interneuron probe --peer 10.77.0.1 --peer-key KEY\n"
      "  interneuron probe --peer 10.77.0.1 --insecure   # a unit that runs so too\n"
      "  interneuron probe --peer 10.77.0.1 --peer-key KEY --nic wwan0 --count 20000 --interval "
      "1ms\n"
      "  interneuron probe --nic wwan0=10.77.0.1 --nic wwan1=10.78.0.1 --peer-key KEY\n"
      "  interneuron probe --peer 192.0.2.7 --stamp --json");
  c->callback([&run, o, stamp, stamp_option] {
    run = [o, stamp, stamp_option] {
      if (stamp_option->count() > 0) {
        o->stamp = *stamp;
        if (settings::is_given(o->keys)) {
          throw process::Failure(process::kUsage,
                                 "--stamp is in the clear: leave out the options of keys");
        }
      }
      return run_probe(*o);
    };
  });
}

}  // namespace interneuron::cli
