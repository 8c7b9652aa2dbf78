#include "lab/coding/image_drives.h"

#include <algorithm>
#include <optional>

#include "lab/sim/offload.h"

namespace interneuron::coding {
namespace {

// Images as they are sent.
struct Way {
  const char* images;
  const char* policy;
  std::vector<sim::LevelRuntime> ladder;
  std::vector<std::size_t> variant_bytes;
  Duration encode;
};

std::vector<Way> ways() {
  const sim::OffloadOptions paper;
  return {
      {"paper", "down_sampling", paper.ladder, paper.variant_bytes, paper.hosts.encode},
      {"jpeg", "joint", sim::jpeg_ladder(),
       std::vector<std::size_t>(sim::kJpegBytes.begin(), sim::kJpegBytes.end()), sim::kJpegEncode}};
}

double local_quality() { return sim::default_ladder().front().quality.front(); }

// A modem that carries nothing.
struct Idle {
  emu::Bottleneck up;
  emu::Bottleneck down;
  Duration one_way{};
};

// The best quality of any way over these modems for a round that begins at `t0`; nothing where none
// is in time.
std::optional<double> best_in_time(const Way& way, const std::vector<Idle>& modems, Duration t0) {
  std::optional<double> best;
  for (const Idle& modem : modems) {
    for (std::size_t v = 0; v < way.variant_bytes.size(); ++v) {
      const Duration there =
          brought(modem.up, t0 + way.encode, way.variant_bytes[v]) + modem.one_way;
      for (const sim::LevelRuntime& level : way.ladder) {
        const Duration computed = there + level.median;
        if (computed - t0 > kImageDeadline) continue;
        const bool in_time = std::ranges::any_of(modems, [&](const Idle& back) {
          return brought(back.down, computed, sim::kResultBytes) + back.one_way - t0 <=
                 kImageDeadline;
        });
        if (in_time && (!best || level.quality[v] > *best)) best = level.quality[v];
      }
    }
  }
  return best;
}

Answers clairvoyant(const Way& way, const Drive& drive, const sim::OffloadResult& run) {
  std::vector<Idle> modems;
  for (const Modem& modem : drive.modems) {
    modems.push_back({emu::Bottleneck(emu::RateTrace{modem.up}),
                      emu::Bottleneck(emu::RateTrace{modem.down}), modem.one_way});
  }
  Answers out;
  for (const sim::OffloadRound& round : run.rounds) {
    const std::optional<double> best = best_in_time(way, modems, round.t0);
    if (best) ++out.on_time;
    out.quality += best.value_or(local_quality()) / static_cast<double>(run.rounds.size());
  }
  return out;
}

ImageRow row_of(const Way& way, const Drive& drive, std::size_t rounds, std::uint64_t seed) {
  sim::OffloadOptions o;
  o.seed = seed;
  o.rounds = static_cast<std::uint32_t>(rounds);
  o.deadline = kImageDeadline;
  o.period = kDrivePeriod;
  for (const Modem& modem : drive.modems) o.profiles.push_back(profile_of(modem));
  o.policy = way.policy;
  o.guard = GuardKind::kBudget;
  o.fallback.local = local_quality();
  o.ladder = way.ladder;
  o.variant_bytes = way.variant_bytes;
  o.hosts.encode = way.encode;
  const sim::OffloadResult run = sim::run_offload(o);
  ImageRow row{way.images, way.policy, {}, clairvoyant(way, drive, run), {}, 0};
  row.by_variant.resize(way.variant_bytes.size());
  for (const sim::OffloadRound& round : run.rounds) {
    const bool remote =
        round.answered() && round.done.outcome == Outcome::kRemote && round.at_road.has_value();
    double quality = local_quality();
    if (remote) {
      ++row.ours.on_time;
      ++row.by_variant[round.at_road->variant];
      quality = way.ladder[round.at_road->level].quality[round.at_road->variant];
    }
    row.ours.quality += quality / static_cast<double>(rounds);
  }
  for (const emu::DirectionStats& up : run.up) {
    row.bytes += static_cast<double>(up.bytes_in) / static_cast<double>(rounds);
  }
  return row;
}

}  // namespace

ImageDriveRow run_image_drive(const Drive& drive, std::size_t rounds, std::uint64_t seed) {
  ImageDriveRow out{drive.name, {}, rounds, {}};
  for (const Modem& modem : drive.modems) {
    out.mbit.push_back(static_cast<double>(emu::mean_rate(*modem.up).bits_per_second) / 1e6);
  }
  for (const Way& way : ways()) out.rows.push_back(row_of(way, drive, rounds, seed));
  return out;
}

}  // namespace interneuron::coding
