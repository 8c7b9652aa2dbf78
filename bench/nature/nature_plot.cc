#include "bench/nature/nature_plot.h"

#include <fmt/format.h>

#include "app/records/plot.h"

namespace interneuron::bench {
namespace {

const char* kHead =
    "set terminal pngcairo size {},1080 font 'sans,11' background rgb 'white'\n"
    "set multiplot layout 4,{} columnsfirst title 'Estimates after steps of the link' font ',13'\n"
    "set border 3\nset tics nomirror out\nset grid ytics lc rgb '#dddddd'\n"
    "set lmargin 9\nset rmargin 2\nset key inside top right horizontal samplen 2\n";

std::string truth_block(const std::string& name, const Run& run) {
  const auto line = [](Duration at, const Conditions& c) {
    return fmt::format("{:.3f} {} {} {}\n", to_seconds(at), c.rtt_ms, c.rate_mbit, 100 * c.loss);
  };
  std::string out = "$" + name + " << EOD\n" + line(Duration::zero(), kBase);
  const auto all = steps();
  for (std::size_t i = 0; i < run.began.size(); ++i) {
    out += line(run.began[i], all[i].before) + line(run.began[i], all[i].after);
  }
  return out + line(run.end, all[run.began.size() - 1].after) + "EOD\n";
}

std::string belief_block(const std::string& name, const Run& run) {
  std::string out = "$" + name + " << EOD\n";
  for (const Belief& b : run.beliefs) {
    out += fmt::format("{:.3f} {:.3f} {:.3f} {:.4f} {:.3f} {:.3f} {:.3f}\n", to_seconds(b.at),
                       b.rtt_ms, b.rate_mbit, 100 * b.loss, b.nature.delay, b.nature.bandwidth,
                       b.nature.reliability);
  }
  return out + "EOD\n";
}

struct Panel {
  const char* title;
  const char* label;
  int column;
  double top;
};

std::string panels(const Run& run, const std::string& truth, const std::string& belief) {
  std::string s = fmt::format("set xrange [0:{:.1f}]\n", to_seconds(run.end));
  for (const Panel& p : {Panel{"round trip p50", "ms", 2, 140}, Panel{"rate up", "Mbit/s", 3, 80},
                         Panel{"loss up", "%", 4, 10}}) {
    s += fmt::format(
        "set title '{}, {}'\nset ylabel '{}'\nset yrange [0:{}]\nunset xlabel\n"
        "plot ${} using 1:{} with lines dt 2 lw 1.6 lc rgb '#222222' title 'set', "
        "${} using 1:{} with lines lw 1.6 lc rgb '#2f6db3' title 'believed'\n",
        p.title, run.loaded ? "under load" : "idle", p.label, p.top, truth, p.column, belief,
        p.column);
  }
  return s + fmt::format(
                 "set title 'Nature scores, {1}'\nset ylabel 'score'\nset yrange [0:1.35]\n"
                 "set xlabel 'time, s'\n"
                 "plot ${0} using 1:5 with lines lw 1.6 lc rgb '#2f6db3' title 'delay', "
                 "${0} using 1:6 with lines lw 1.6 lc rgb '#e08a00' title 'bandwidth', "
                 "${0} using 1:7 with lines lw 1.6 lc rgb '#7b3fa0' title 'reliability'\n",
                 belief, run.loaded ? "under load" : "idle");
}

}  // namespace

bool plot_nature(const std::filesystem::path& file, const std::vector<Run>& runs) {
  std::string data;
  std::string plots;
  for (std::size_t i = 0; i < runs.size(); ++i) {
    const std::string truth = fmt::format("truth{}", i);
    const std::string belief = fmt::format("belief{}", i);
    data += truth_block(truth, runs[i]) + belief_block(belief, runs[i]);
    plots += panels(runs[i], truth, belief);
  }
  const std::string head = fmt::format(fmt::runtime(kHead), 720 * runs.size(), runs.size());
  return records::draw(file, data + head + plots + "unset multiplot\n");
}

}  // namespace interneuron::bench
