// Draws docs/guard.png: what guard `budget` knows of the rounds of the paper's experiment, what it
// therefore chooses, and what that comes to on a simulated drive. The first two panels ask the law
// and the choice that the guard itself uses; the last one is a run of the simulated pipeline.
//
//   guard_picture FILE.png [SEED]
#include <fmt/format.h>

#include <cstdio>
#include <cstdlib>
#include <random>

#include "app/process/failure.h"
#include "app/records/plot.h"
#include "core/guard/choice.h"
#include "lab/emu/profile.h"
#include "lab/sim/offload.h"

namespace interneuron::bench {
namespace {

using namespace std::chrono_literals;

// What one round of the paper's experiment loses (docs/evaluation.md, "Delays"): 15 to 50 ms in
// one of four modules, two of them before the computation begins, in three rounds of four.
constexpr double kInjected = 0.75;
constexpr Duration kDelayed = 30ms;

guard::ResidualLaw experiment(std::uint64_t seed) {
  guard::ResidualLaw law;
  law.set_scale(130ms / guard::kTail);
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> unit;
  for (std::uint32_t i = 0; i < guard::ResidualLaw::kRounds; ++i) {
    guard::ResidualLaw::Sample sample{.round = RoundId{i}};
    const Duration delay{static_cast<std::int64_t>(unit(random) * 35e6 + 15e6)};
    if (unit(random) < kInjected) (unit(random) < 0.5 ? sample.before : sample.computed) = delay;
    law.add(TimePoint{i * 100ms}, sample);
  }
  return law;
}

// Lines "left, P lost nothing, P lost 30 ms, worth of each level" in ms.
std::string knowledge(const guard::ResidualLaw& law) {
  const auto levels = sim::profiles_of(sim::default_ladder());
  const guard::Terms terms{.miss_price = 0.5, .local_quality = levels[0].quality[0]};
  const auto none = law.near(0ms, 130ms / guard::kAlike);
  const auto some = law.near(kDelayed, 130ms / guard::kAlike);
  std::string out = "$known << EOD\n";
  for (int tenth = 0; tenth <= 1100; tenth += 5) {
    const Duration left = tenth * 100us;
    out += fmt::format("{} {:.4f} {:.4f}", tenth / 10.0, none.within(left), some.within(left));
    for (std::size_t level = 0; level < levels.size(); ++level) {
      const auto one = std::span(levels).subspan(level, 1);
      out += fmt::format(" {:.4f}",
                         guard::best_level(one, 0, none, {}, TimePoint{}, left, terms).second);
    }
    out += "\n";
  }
  return out + "EOD\n";
}

// Lines "round, began, end to end, level", in ms; a round that was missed ends at the deadline.
std::string drive(std::uint64_t seed) {
  sim::OffloadOptions options;
  options.seed = seed;
  options.guard = GuardKind::kBudget;
  options.profiles = {*emu::built_in_profile("5g"), *emu::built_in_profile("4g")};
  options.fallback.local = options.ladder[0].quality[0];
  std::string out = "$drive << EOD\n";
  for (const sim::OffloadRound& round : sim::run_offload(options).rounds) {
    if (!round.at_road || !round.at_road->began) continue;
    const bool is_missed = round.done.outcome != Outcome::kRemote;
    out +=
        fmt::format("{} {:.2f} {:.2f} {}\n", round.round, to_ms(*round.at_road->began - round.t0),
                    to_ms(round.done.e2e), is_missed ? std::size_t{3} : round.at_road->level);
  }
  return out + "EOD\n";
}

std::string script(std::uint64_t seed) {
  std::string s =
      "set terminal pngcairo size 1180,860 font 'sans,11' background rgb 'white'\n" +
      knowledge(experiment(seed)) + drive(seed) +
      "set border 3\nset tics nomirror out\nset grid ytics lc rgb '#dddddd'\n"
      "set multiplot\nset size 0.5,0.5\nset origin 0,0.5\nset key bottom right\n"
      "set title 'What it knows: the last 512 rounds'\nset xlabel 'time left for what a round may "
      "lose, ms'\nset ylabel 'P(on time)'\nset yrange [0:1.05]\nset xrange [0:70]\n"
      "plot $known using 1:2 with lines lw 2 lc rgb '#2f6db3' title 'lost nothing so far', "
      "$known using 1:3 with lines lw 2 lc rgb '#c2562d' title 'lost 30 ms already'\n"
      "set origin 0.5,0.5\nset title 'What it chooses: the level worth most'\n"
      "set xlabel 'time left when the computation begins, ms'\nset ylabel 'expected quality - "
      "price "
      "of misses'\nset yrange [-0.4:0.45]\nset xrange [0:110]\nplot ";
  const char* colours[] = {"#999999", "#d9a441", "#3a8f5c", "#c2342d"};
  const char* names[] = {"L0", "L2", "L4", "missed"};
  for (int i = 0; i < 3; ++i) {
    s += fmt::format("$known using 1:{} with lines lw 2 lc rgb '{}' title '{}', ", i + 4,
                     colours[i], names[i]);
  }
  s += fmt::format(
      "1/0 notitle\nset size 1,0.5\nset origin 0,0\nset title 'What came of it: 300 rounds over 5G "
      "and 4G while driving, seed {}'\nset key top right horizontal\nset xlabel 'round'\n"
      "set ylabel 'ms since the frame'\nset yrange [0:160]\nset xrange [0:300]\n"
      "plot 130 with lines dt 2 lc rgb '#222222' title 'deadline', "
      "$drive using 1:2 with lines lc rgb '#9db7d5' title 'computation began', ",
      seed);
  for (int i = 0; i < 4; ++i) {
    s += fmt::format(
        "$drive using 1:($4=={0}?$3:1/0) with points pt 7 ps 0.6 lc rgb '{1}' title '{2}'{3}", i,
        colours[i], names[i], i < 3 ? ", " : "\n");
  }
  return s;
}

}  // namespace
}  // namespace interneuron::bench

int main(int argc, char** argv) {
  if (argc < 2 || argc > 3 || argv[1][0] == '-') {
    std::fputs("usage: guard_picture FILE.png [SEED]\n", stderr);
    return 2;
  }
  const std::uint64_t seed = argc == 3 ? std::strtoull(argv[2], nullptr, 10) : 2020;
  try {
    return interneuron::records::draw(argv[1], interneuron::bench::script(seed)) ? 0 : 1;
  } catch (const interneuron::process::Failure& failure) {
    std::fprintf(stderr, "guard_picture: %s\n", failure.what());
    return failure.code();
  }
}
