#include "app/cli/commands.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <cstdlib>
#include <memory>
#include <thread>

#include "app/process/failure.h"
#include "app/process/signals.h"
#include "app/settings/config_file.h"
#include "app/settings/link_options.h"
#include "app/watch/screen.h"
#include "app/watch/source.h"
#include "node/io/steady_clock.h"

namespace interneuron::cli {
namespace {

using namespace std::chrono_literals;

// The time of one column of a sparkline.
constexpr Duration kSample = 500ms;
// A key, a new size of the window and a signal wait at most so long.
constexpr int kKeyWaitMs = 100;

struct TopOptions {
  watch::LinkSourceOptions source;
  bool once = false;
  double seconds = 3;
  std::size_t width = 100;
  bool no_color = false;
};

bool colored(const TopOptions& o) {
  // Any value turns colours off (https://no-color.org).
  const char* no_color = std::getenv("NO_COLOR");
  return !o.no_color && (no_color == nullptr || *no_color == '\0');
}

// While the screen is ours, a log line would tear it.
class Silence {
 public:
  Silence() : level_(spdlog::get_level()) { spdlog::set_level(spdlog::level::off); }
  ~Silence() { spdlog::set_level(level_); }
  Silence(const Silence&) = delete;
  Silence& operator=(const Silence&) = delete;

 private:
  spdlog::level::level_enum level_;
};

int live(const TopOptions& o) {
  const auto source = watch::make_link_source(o.source);
  const Silence silence;
  watch::LinksHistory history;
  watch::Terminal terminal(colored(o));
  TimePoint next = io::now();
  for (int key = 0; key != 'q' && key != 'Q' && process::SignalWatch::last() == 0;) {
    if (io::now() >= next) {
      next = std::max(next + kSample, io::now());
      history.add(source->snapshot());
    }
    terminal.show(watch::draw(
        history,
        {.width = terminal.width(), .height = terminal.height(), .unicode = terminal.unicode()}));
    key = terminal.key(kKeyWaitMs);
  }
  return process::kFine;
}

int once(const TopOptions& o) {
  const auto source = watch::make_link_source(o.source);
  watch::LinksHistory history;
  const TimePoint end = io::now() + from_ms(o.seconds * 1000);
  history.add(source->snapshot());
  while (io::now() < end && process::SignalWatch::last() == 0) {
    std::this_thread::sleep_for(std::min(kSample, end - io::now()));
    history.add(source->snapshot());
  }
  fmt::print("{}", watch::plain_text(watch::draw(history, {.width = o.width})));
  return process::kFine;
}

}  // namespace

void add_top(CLI::App& program, std::function<int()>& run) {
  auto o = std::make_shared<TopOptions>();
  CLI::App* c = program.add_subcommand("top", "The links of this host, live");
  settings::add_config_option(*c);
  watch::add_source_options(*c, o->source);
  auto* once_flag = c->add_flag("--once", o->once, "One frame as text, then the end");
  c->add_option("--for", o->seconds, "Seconds that --once looks")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 3600.0))
      ->needs(once_flag);
  c->add_option("--width", o->width, "Columns of --once")
      ->capture_default_str()
      ->check(CLI::Range(40, 1000))
      ->needs(once_flag);
  c->add_flag("--no-color", o->no_color, "No colour; NO_COLOR in the environment does the same");
  c->footer(
      "Examples:\n  interneuron top\n  interneuron top --peer 192.0.2.7 --peer-key ROAD_KEY\n"
      "  interneuron top --once --for 10 --width 120");
  c->callback([&run, o] {
    run = [o] {
      if (!o->once && (::isatty(STDOUT_FILENO) == 0 || ::isatty(STDIN_FILENO) == 0)) {
        throw process::Failure(
            process::kUsage,
            "top needs a terminal; without one use `interneuron links --json-stream`, or "
            "--once for one frame");
      }
      const process::SignalWatch signals;
      const int code = o->once ? once(*o) : live(*o);
      return process::SignalWatch::last() != 0 ? 128 + process::SignalWatch::last() : code;
    };
  });
}

}  // namespace interneuron::cli
