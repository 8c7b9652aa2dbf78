// fig-rt: the paper's scripted sequence (Fig. rt_guarantee), and where the time of two of its
// rounds went.
#include <fmt/format.h>

#include <map>

#include "core/wire/packet.h"
#include "core/wire/round_header.h"
#include "lab/eval/experiments/document.h"
#include "lab/eval/experiments/experiment.h"
#include "lab/sim/fig_rt_guarantee.h"

namespace interneuron::experiments {
namespace {

// The sampled image is used at exactly D1; D1 and D2 are missed.
constexpr std::uint32_t kShownRounds[] = {6, 11};
// '+' in the figure, θ1 ≫ D1: later by more than this part of the deadline, as in the demo's plot.
constexpr int kFarLateDivisor = 5;
constexpr const char* kLinks[] = {"5g", "4g"};

// The fragments of one message over one link.
struct Journey {
  // Fragment 0 has it.
  std::optional<wire::RoundHeader> header;
  bool up = false;
  // When each fragment was sent, in world time.
  std::vector<Duration> sent;
  std::uint16_t fragments = 0;
};

// Notes every fragment that an endpoint hands over.
class Journal {
 public:
  void attach(sim::World& world) {
    world.on_sent([this, &world](sim::HostId host, LinkId link, ByteView bytes) {
      const auto packet = wire::parse(bytes);
      if (!packet || packet->header.type != wire::PacketType::kData) return;
      const wire::Data& data = packet->data;
      Journey& journey = journeys_[{host, link, data.fragment.message}];
      journey.up = host == 0;
      journey.fragments = data.fragment.count();
      journey.sent.push_back(world.now());
      if (data.fragment.index == 0) journey.header = wire::parse_round_header(data.bytes);
    });
  }

  std::vector<Waterfall::Send> of_round(std::uint32_t round, Duration t0) const {
    // A message over several links may have its first fragment on another one.
    std::map<std::pair<sim::HostId, MessageId>, wire::RoundHeader> headers;
    for (const auto& [key, journey] : journeys_) {
      const auto& [host, link, message] = key;
      if (journey.header) headers.insert({{host, message}, *journey.header});
    }
    std::vector<Waterfall::Send> out;
    for (const auto& [key, journey] : journeys_) {
      const auto& [host, link, message] = key;
      const auto header = headers.find({host, message});
      if (header == headers.end() || header->second.round.round.value != round) continue;
      std::vector<double> sent;
      for (const Duration at : journey.sent) sent.push_back(to_ms(at - t0));
      const bool result = header->second.message_class == MessageClass::kResult;
      out.push_back({.link = kLinks[link.value],
                     .direction = journey.up ? "up" : "down",
                     .what = result                        ? "result"
                             : header->second.variant == 0 ? "raw"
                                                           : "sampled",
                     .fragments = journey.fragments,
                     .sent_ms = std::move(sent)});
    }
    return out;
  }

 private:
  std::map<std::tuple<sim::HostId, LinkId, MessageId>, Journey> journeys_;
};

std::string marks_of(const sim::OffloadRound& r, Duration deadline) {
  const Verdict& verdict = r.at_road->verdict;
  std::string marks;
  if (verdict.released_at_deadline) marks = "θ1 = D1, sampled used";
  if (verdict.late) marks = verdict.overrun > deadline / kFarLateDivisor ? "θ1 ≫ D1" : "θ1 > D1";
  if (r.done.degraded_final) marks += std::string(marks.empty() ? "" : ", ") + "θ2 > D2";
  return marks;
}

ScriptRow row_of(const sim::OffloadRound& r, Duration deadline) {
  ScriptRow row{.round = r.round,
                .on_time = r.done.outcome == Outcome::kRemote,
                .theta3_ms = to_ms(r.done.e2e),
                .x = r.done.x_permille / 1000.0,
                .road = {}};
  if (!r.at_road) return row;
  const auto& road = *r.at_road;
  const Verdict& verdict = road.verdict;
  const Duration theta1 = road.delivered - r.t0;
  ScriptRow::Road& at = row.road.emplace(ScriptRow::Road{});
  at.theta1_ms = to_ms(theta1);
  if (road.ended) at.theta2_ms = to_ms(*road.ended - r.t0);
  // Both clocks of the script agree, so θ1 - D1 tells D1.
  const bool told = verdict.late && verdict.overrun != kFullSeverity;
  if (verdict.released_at_deadline) {
    at.d1_ms = to_ms(theta1);
  } else if (told) {
    at.d1_ms = to_ms(theta1 - verdict.overrun);
  }
  at.image = road.variant == 0 ? "raw" : "sampled";
  at.level = road.level;
  at.d1_missed = verdict.late;
  at.at_d1 = verdict.released_at_deadline;
  at.d2_missed = r.done.degraded_final;
  at.marks = marks_of(r, deadline);
  return row;
}

}  // namespace

void run_fig_rt(const Request& request, Document& document) {
  const Duration deadline = sim::OffloadOptions{}.deadline;
  Journal journal;
  sim::OffloadResult result;
  request.progress.for_each("fig-rt", 1, [&](std::size_t) {
    result = sim::run_fig_rt_guarantee([&](sim::World& world) { journal.attach(world); });
  });
  std::vector<ScriptRow> rows;
  for (const sim::OffloadRound& r : result.rounds) rows.push_back(row_of(r, deadline));
  document.tables.push_back(
      {"rounds",
       "The scripted sequence, guard `paper`",
       "The script: both uplinks as usual in rounds 0-2; raw slower in 3-4; raw far too slow "
       "in 5-7; both slow in 8-12, the sampled image ever more. D1 is told where it was met "
       "exactly or missed; ≫: by more than a fifth of the deadline.",
       {{"/round", "round"},
        {"/theta1_ms", "θ1, ms", 1},
        {"/d1_ms", "D1, ms", 1},
        {"/theta2_ms", "θ2, ms", 1},
        {"/theta3_ms", "θ3, ms", 1},
        {"/x", "X", 3},
        {"/image", "image"},
        {"/level", "level"},
        {"/marks", "marks"}},
       std::move(rows)});
  for (const std::uint32_t round : kShownRounds) {
    const sim::OffloadRound& r = result.rounds[round];
    document.waterfalls.push_back(
        {round, to_ms(deadline), row_of(r, deadline), journal.of_round(round, r.t0)});
  }
  document.rounds_per_seed = sim::kFigRtRounds;
  document.seeds.reset();
  document.notes.push_back(
      "Scripted delays on constant links: --rounds and --seeds do not matter.");
}

}  // namespace interneuron::experiments
