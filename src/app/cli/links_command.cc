#include "app/cli/commands.h"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>
#include <optional>
#include <thread>

#include "app/process/failure.h"
#include "app/process/signals.h"
#include "app/process/status_line.h"
#include "app/settings/command_line.h"
#include "app/settings/config_file.h"
#include "app/settings/link_options.h"
#include "app/watch/json.h"
#include "app/watch/source.h"
#include "app/watch/table.h"
#include "node/io/steady_clock.h"

namespace interneuron::cli {
namespace {

using namespace std::chrono_literals;

// After these seconds one train or two have measured the rates of all links.
constexpr double kMeasureSeconds = 3;
// A program on this host tells its links twice a second; for one that does not, nobody waits long.
constexpr Duration kLocalWait = 1200ms;
constexpr Duration kPoll = 50ms;

struct LinksOptions {
  watch::LinkSourceOptions source;
  std::optional<double> seconds;
  double interval_s = 1;
  bool json = false;
  bool stream = false;
};

int no_answer(const watch::LinkSource& source) {
  fmt::print(stderr,
             "interneuron: no answer from {}; is `interneuron road` running there, the port open, "
             "and does each trust the other's key, or have both --insecure? `interneuron doctor` "
             "looks for what this host may be missing\n",
             source.peer_text());
  return process::kFailed;
}

// False: the reader has seen enough.
bool written() {
  if (std::fflush(stdout) == 0) return true;
  if (errno == EPIPE) return false;
  throw process::Failure(process::kFailed,
                         std::string("cannot write the figures: ") + std::strerror(errno));
}

// What would have no effect is a mistake.
void refuse_useless(const CLI::App& command, const LinksOptions& o) {
  if (command.count("--interval") > 0 && !o.stream) {
    throw process::Failure(process::kUsage, "--interval is for a stream; add --json-stream");
  }
  if (command.count("--for") > 0 && !o.stream && !watch::measures(o.source)) {
    throw process::Failure(process::kUsage,
                           "--for is for measuring; add --peer HOST, --link or --json-stream");
  }
}

// One object per line and interval, until the time or a signal ends it.
int stream(const LinksOptions& o, watch::LinkSource& source) {
  const TimePoint start = io::now();
  TimePoint next = start;
  while (process::SignalWatch::last() == 0 &&
         (!o.seconds || io::now() < start + from_ms(*o.seconds * 1000))) {
    if (io::now() >= next) {
      next = std::max(next + from_ms(o.interval_s * 1000), io::now());
      fmt::print("{}\n", watch::links_json(source.snapshot()).dump());
      if (!written()) return process::kFine;
    }
    std::this_thread::sleep_for(std::min(kPoll, next - io::now()));
  }
  return source.answered() ? process::kFine : no_answer(source);
}

int once(const LinksOptions& o, watch::LinkSource& source) {
  const TimePoint start = io::now();
  const Duration patience =
      watch::measures(o.source) ? from_ms(o.seconds.value_or(kMeasureSeconds) * 1000) : kLocalWait;
  process::StatusLine progress;
  watch::LinksSnapshot s = source.snapshot();
  while (process::SignalWatch::last() == 0 && io::now() < start + patience) {
    // Programs on this host tell soon; without any there is nothing to wait for.
    if (!watch::measures(o.source) && !source.expects_more()) break;
    if (watch::measures(o.source)) {
      const Duration left = std::max(start + patience - io::now(), Duration::zero());
      progress.show(
          fmt::format("measuring towards {}: {:.0f} s", source.peer_text(), to_ms(left) / 1000));
    }
    std::this_thread::sleep_for(kPoll);
    s = source.snapshot();
  }
  progress.clear();
  if (o.json) {
    fmt::print("{}\n", watch::links_json(s).dump(2));
  } else {
    fmt::print("{}", watch::links_table(s));
  }
  written();
  return source.answered() ? process::kFine : no_answer(source);
}

}  // namespace

void add_links(CLI::App& program, std::function<int()>& run) {
  auto o = std::make_shared<LinksOptions>();
  CLI::App* c = program.add_subcommand(
      "links", "The network cards of this host: what the kernel says and what was measured");
  settings::add_config_option(*c);
  watch::add_source_options(*c, o->source);
  c->add_option("--for", o->seconds, "Seconds to measure (default: 3; a stream: until Ctrl-C)")
      ->check(settings::positive_number());
  c->add_option("--interval", o->interval_s, "Seconds between two lines of a stream")
      ->capture_default_str()
      ->check(CLI::Range(0.1, 3600.0));
  auto* json = c->add_flag("--json", o->json, "As JSON (docs/schema/links.json)");
  c->add_flag("--json-stream", o->stream, "One JSON object per line and interval")->excludes(json);
  c->footer(
      "Examples:\n  interneuron links\n  interneuron links --peer 192.0.2.7 --peer-key ROAD_KEY "
      "--for "
      "5 --json\n  interneuron links --link 'wwan*=192.0.2.7:47000,metered' --peer-key ROAD_KEY\n"
      "  interneuron links --json-stream | jq -c '.links[] | {name, rtt_ms, nature}'");
  c->callback([&run, o, c] {
    run = [o, c] {
      refuse_useless(*c, *o);
      const process::SignalWatch signals;
      const auto source = watch::make_link_source(o->source);
      const int code = o->stream ? stream(*o, *source) : once(*o, *source);
      const int signal = process::SignalWatch::last();
      // A stream without an end is ended by a signal: that is no failure.
      return signal != 0 && (!o->stream || o->seconds) ? 128 + signal : code;
    };
  });
}

}  // namespace interneuron::cli
