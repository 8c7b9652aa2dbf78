#include "lab/eval/run.h"

#include <numeric>

#include "lab/eval/bounds.h"

namespace interneuron::eval {
namespace {

emu::LinkProfile constant_link(const char* name, double rtt_ms, double mbit) {
  emu::LinkProfile link = emu::constant_link(name, rtt_ms, mbit, mbit);
  link.up.queue_bytes = static_cast<std::size_t>(mbit * 1e3 * to_ms(emu::kDefaultQueueTime) / 8);
  link.down = link.up;
  return link;
}

sim::Disturbance disturbance_of(const Trace& trace, std::size_t round) {
  sim::Disturbance out;
  if (round < trace.compute_noise.size()) out.deviations = trace.compute_noise[round];
  const Injected& injected = trace.rounds[round];
  if (!injected.any) return out;
  switch (injected.module) {
    case Module::kUplink:
      if (injected.link) {
        // Links beyond the last entry have the last.
        out.uplink.resize(*injected.link + 2);
        out.uplink[*injected.link] = injected.delay;
      } else {
        out.uplink = {injected.delay};
      }
      break;
    case Module::kBeforeCompute:
      out.before_compute = injected.delay;
      break;
    case Module::kInsideCompute:
      out.inside_compute = injected.delay;
      break;
    case Module::kDownlink:
      out.downlink = injected.delay;
      break;
  }
  return out;
}

// What the vehicle submits, as the profile counts the variants. `player`: of LevelRule::kCausal.
std::vector<std::uint8_t> submitted(const System& system, const Profile& profile,
                                    const std::optional<Player>& player) {
  if (player) return {player->variant};
  if (system.only_variant) return {*system.only_variant};
  if (!system.whole_ladder) return {0, profile.sampled};
  std::vector<std::uint8_t> all(profile.variants.size());
  std::iota(all.begin(), all.end(), std::uint8_t{0});
  return all;
}

sim::OffloadOptions options_of(const System& system, const Scenario& scenario, const Trace& trace,
                               std::uint64_t seed, const std::vector<std::uint8_t>& variants) {
  sim::OffloadOptions o;
  o.seed = seed;
  o.rounds = static_cast<std::uint32_t>(trace.rounds.size());
  o.period = scenario.period;
  o.deadline = scenario.deadline;
  o.profiles = scenario.links;
  o.only_link = system.only_link;
  o.policy = system.policy;
  o.guard = system.guard;
  o.fallback = scenario.profile.fallback;
  o.ladder.clear();
  for (std::size_t i = 0; i < scenario.profile.levels.size(); ++i) {
    const LevelProfile& level = scenario.profile.levels[i];
    o.ladder.push_back({scenario.profile.level_names[i], level.median, level.p95, {}});
    for (const std::uint8_t variant : variants) {
      o.ladder.back().quality.push_back(remote_quality(scenario.profile, i, variant));
    }
  }
  if (system.level != LevelRule::kGuard) o.top_level = o.ladder.size() - 1;
  o.variant_bytes.clear();
  for (const std::uint8_t variant : variants) {
    o.variant_bytes.push_back(scenario.profile.variants.at(variant).bytes);
  }
  o.ablation = system.ablation;
  o.local_backup = system.local_backup;
  o.road_clock = scenario.road_clock;
  o.road_step = scenario.clock_step;
  o.is_encrypted = scenario.is_encrypted;
  o.learns_budget = scenario.learns_budget;
  o.hosts = scenario.hosts;
  for (std::size_t i = 0; i < trace.rounds.size(); ++i) {
    o.disturbances.push_back(disturbance_of(trace, i));
  }
  return o;
}

sim::LevelRule rule_of(const System& system, const Scenario& scenario,
                       const std::optional<Player>& player, const sim::OffloadOptions& options) {
  switch (system.level) {
    case LevelRule::kErdos:
    case LevelRule::kErdosE2e:
      return erdos_rule(scenario.erdos ? *scenario.erdos : erdos_times(options), options.deadline,
                        system.level == LevelRule::kErdosE2e);
    case LevelRule::kFixedTop:
      return [top = options.ladder.size() - 1](auto...) { return top; };
    case LevelRule::kCausal:
      return player.value().level;
    case LevelRule::kGuard:
      break;
  }
  return nullptr;
}

// "raw:5g sampled:4g".
std::string plan_text(const Plan& plan, const std::vector<std::uint8_t>& variants,
                      const Scenario& scenario) {
  std::string out;
  for (const Assignment& send : plan.sends) {
    if (!out.empty()) out += ' ';
    out += scenario.profile.variants.at(variants.at(send.variant)).name + ':' +
           scenario.links.at(send.link.value).name;
  }
  return out;
}

// What the application got; `rounds`: up to and with this one.
Shown shown_of(const RoundDone& done, bool local_backup, const std::vector<Round>& rounds) {
  const Round& now = rounds.back();
  if (done.outcome == Outcome::kRemote) return {Shown::Kind::kRemote, now.level, now.variant, 0};
  if (!done.age_rounds) return {};
  if (*done.age_rounds == 0) return {Shown::Kind::kLocal, 0, 0, 0};
  const std::uint32_t age = *done.age_rounds;
  // The old result may be a local one.
  if (!done.stale_remote && local_backup) return {Shown::Kind::kStale, 0, 0, age};
  const Round& then = rounds.at(rounds.size() - 1 - age);
  return {Shown::Kind::kStale, then.level, then.variant, age};
}

void copy_road(const sim::OffloadRound& from, const std::vector<std::uint8_t>& variants,
               Round& to) {
  if (!from.at_road) return;
  const sim::OffloadRound::AtRoad& road = *from.at_road;
  to.delivered = road.delivered - from.t0;
  if (road.began) to.compute_began = *road.began - from.t0;
  if (road.ended) to.compute_ended = *road.ended - from.t0;
  to.variant = variants.at(road.variant);
  to.level = road.level;
  to.verdict = road.verdict;
  to.degraded_first = road.degraded;
  const bool has_overrun = road.verdict.late && road.verdict.overrun != kFullSeverity;
  if (has_overrun || road.verdict.released_at_deadline) {
    to.d1 = *to.delivered - (has_overrun ? road.verdict.overrun : Duration{});
  }
}

}  // namespace

Scenario table_erdos_scenario() {
  Scenario s;
  s.name = "table-erdos";
  s.links = {constant_link("5g", 22, 100), constant_link("4g", 45, 30)};
  return s;
}

Run run(const System& system, const Scenario& scenario, const Trace& trace, std::uint64_t seed) {
  std::optional<Player> player;
  if (system.level == LevelRule::kCausal) player = causal_player(scenario, trace).value();
  const std::vector<std::uint8_t> variants = submitted(system, scenario.profile, player);
  sim::OffloadOptions options = options_of(system, scenario, trace, seed, variants);
  options.level_rule = rule_of(system, scenario, player, options);
  const sim::OffloadResult result = sim::run_offload(options);
  Run out;
  out.system = system.name;
  out.seed = seed;
  for (const sim::OffloadRound& from : result.rounds) {
    Round& round = out.rounds.emplace_back();
    round.round = from.round;
    round.t0 = from.t0;
    round.on_time = from.done.outcome == Outcome::kRemote;
    round.e2e = from.done.e2e;
    round.plan = plan_text(from.plan, variants, scenario);
    copy_road(from, variants, round);
    round.degraded_final = from.done.degraded_final;
    round.x_permille = from.done.x_permille;
    round.recovering = from.done.recovering;
    round.injected = trace.rounds[from.round];
    round.shown = shown_of(from.done, system.local_backup, out.rounds);
  }
  for (const emu::DirectionStats& up : result.up) out.bytes_up.push_back(up.bytes_in);
  for (const emu::DirectionStats& down : result.down) out.bytes_down.push_back(down.bytes_in);
  return out;
}

}  // namespace interneuron::eval
