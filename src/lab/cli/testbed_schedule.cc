#include "lab/cli/testbed_command.h"

#include <fmt/format.h>

#include <functional>
#include <vector>

#include "app/process/failure.h"
#include "app/records/plot.h"
#include "lab/emu/scenario_player.h"

namespace interneuron::cli {
namespace {

struct Row {
  Duration at;
  std::size_t link;
  emu::Conditions up;
  emu::Conditions down;

  double rtt_ms() const { return to_ms(up.one_way + down.one_way); }
};

void for_each_step(emu::ScenarioPlayer& player, Duration length,
                   const std::function<void(const Row&)>& take) {
  for (Duration t{}; t < length; t += emu::kDelayStep) {
    player.play(t);
    for (std::size_t i = 0; i < player.size(); ++i) {
      emu::Link& link = player.link(i);
      take({t, i, link.conditions(emu::Direction::kUp, t),
            link.conditions(emu::Direction::kDown, t)});
    }
  }
}

void print_csv(emu::ScenarioPlayer& player, Duration length) {
  fmt::print("t_s,link,rtt_ms,loss_up,loss_down,rate_up_mbit,rate_down_mbit\n");
  for_each_step(player, length, [&](const Row& row) {
    fmt::print("{:.2f},{},{:.3f},{:.6g},{:.6g},{:.6g},{:.6g}\n", to_ms(row.at) / 1e3,
               player.scenario().links[row.link].name, row.rtt_ms(), row.up.loss, row.down.loss,
               row.up.rate.mbit(), row.down.rate.mbit());
  });
}

// gnuplot's terminal for the format that the file's suffix names.
const char* terminal_for(const std::string& file) {
  if (file.ends_with(".png")) return "pngcairo";
  if (file.ends_with(".svg")) return "svg";
  throw process::Failure(process::kUsage,
                         "--plot '" + file + "': give a file that ends in .png or .svg");
}

// Round-trip times on a logarithmic scale, with a gap where there is no radio.
std::string script(emu::ScenarioPlayer& player, Duration length, const std::string& file) {
  std::vector<std::string> points(player.size());
  for_each_step(player, length, [&](const Row& row) {
    const bool out = row.up.loss >= 1 && row.down.loss >= 1;
    points[row.link] +=
        out ? "\n" : fmt::format("{:.2f} {:.3f}\n", to_ms(row.at) / 1e3, row.rtt_ms());
  });
  std::string s;
  std::string plot;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const emu::ScenarioLink& link = player.scenario().links[i];
    s += fmt::format("$link{} << EOD\n{}EOD\n", i, points[i]);
    plot +=
        fmt::format("{}$link{} using 1:2 with lines lw 1.4 title {}", i > 0 ? ", " : "plot ", i,
                    records::gnuplot_text(fmt::format("{} ({})", link.name, link.profile.name)));
  }
  return s + fmt::format(
                 "set terminal {} size 1100,420 font 'sans,11' background rgb 'white'\n"
                 "set title 'Round-trip times that the links prescribe, seed {}'\n"
                 "set xlabel 'time, s'\nset ylabel 'round-trip time, ms'\nset logscale y\n"
                 "set xrange [0:{}]\nset key outside above noenhanced samplen 2\nset border 3\n"
                 "set linetype 1 lc rgb '#2f6db3'\nset linetype 2 lc rgb '#e08a00'\n"
                 "set linetype 3 lc rgb '#7b3fa0'\nset linetype 4 lc rgb '#3a8f5c'\n"
                 "set tics nomirror out\nset grid ytics lc rgb '#dddddd'\n{}\n",
                 terminal_for(file), player.scenario().seed, to_ms(length) / 1e3, plot);
}

}  // namespace

int print_schedule(const emu::Scenario& scenario, Duration length, const std::string& plot) {
  emu::ScenarioPlayer player(scenario);
  if (plot.empty()) {
    print_csv(player, length);
    return process::kFine;
  }
  return records::draw(plot, script(player, length, plot)) ? process::kFine : process::kFailed;
}

}  // namespace interneuron::cli
