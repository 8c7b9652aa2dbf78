// fig-adjust: what the adjustable qualities cost and are worth: (a) accuracy and (b) time of the
// levels, (c) accuracy of raw and sampled images, (d) transmission time of messages per network.
#include <fmt/format.h>

#include "core/base/statistics.h"
#include "lab/eval/experiments/document.h"
#include "lab/eval/experiments/experiment.h"
#include "lab/eval/quality.h"
#include "lab/sim/world.h"

namespace interneuron::experiments {
namespace {

using std::chrono::seconds;

constexpr PipelineId kMessages{0};
// The sizes of the paper's messages, in units of 1024 bytes.
constexpr std::size_t kKilobytes[] = {5, 128, 512};
constexpr const char* kNetworks[] = {"4g", "5g"};
// Links are measured before the first message; a message has gone, or is given up, before the next.
constexpr Duration kWarmUp = seconds(1);
constexpr Duration kPeriod = seconds(2);
constexpr Duration kGivenUp = seconds(2);

// The time of each message over one link, from its hand-over to its delivery.
struct Sent {
  std::vector<double> ms;
  std::uint32_t undelivered = 0;
};

// Alone on its link, by the production endpoints; an answer of one byte ends the round.
Sent transmit(const std::string& network, std::size_t bytes, std::uint64_t seed,
              std::uint32_t messages) {
  sim::World world(seed);
  PipelineConfig pipeline{.id = kMessages,
                          .stages = {StageKind::kCommunication, StageKind::kCommunication},
                          .deadline = kGivenUp,
                          .period = kPeriod,
                          .policy = "best_link"};
  EndpointOptions options{
      .session = SessionId{1}, .pipelines = {pipeline}, .policies = builtin_policies()};
  const sim::HostId vehicle = world.add_host(std::move(options));
  const sim::HostId road = world.add_host({.session = SessionId{2},
                                           .pipelines = {},
                                           .policies = builtin_policies(),
                                           .accept_peers = true});
  const emu::LinkProfile profile = *emu::built_in_profile(network);
  world.add_link(vehicle, road, LinkId{0}, network, emu::Link(profile, emu::link_seed(seed, 0)));
  Sent out;
  Duration began{};
  world.on_event([&](sim::HostId host, Event&& event) {
    const auto* delivered = std::get_if<Delivered>(&event);
    if (delivered == nullptr || host != road) return;
    out.ms.push_back(to_ms(world.now() - began));
    world.endpoint(road).submit(world.local_time(road), delivered->round, {Bytes(1)},
                                MessageClass::kResult);
  });
  const PeerId peer = world.connect(vehicle, road);
  for (std::uint32_t i = 0; i < messages; ++i) {
    world.at(kWarmUp + i * kPeriod, [&] {
      Endpoint& endpoint = world.endpoint(vehicle);
      const TimePoint now = world.local_time(vehicle);
      began = world.now();
      endpoint.submit(now, endpoint.begin_round(now, kMessages), {Bytes(bytes)},
                      MessageClass::kData, peer);
      world.flush(vehicle);
    });
    world.run_until(kWarmUp + (i + 1) * kPeriod);
  }
  out.undelivered = messages - static_cast<std::uint32_t>(out.ms.size());
  return out;
}

TransmissionRow transmission_row(const Request& request, const char* network,
                                 std::size_t kilobytes) {
  std::vector<Sent> all(request.seeds());
  request.progress.for_each(
      fmt::format("fig-adjust {} KB over {}", kilobytes, network), all.size(), [&](std::size_t i) {
        all[i] = transmit(network, kilobytes * 1024, request.first_seed + i, request.rounds);
      });
  std::vector<double> ms;
  std::uint64_t undelivered = 0;
  for (const Sent& sent : all) {
    ms.insert(ms.end(), sent.ms.begin(), sent.ms.end());
    undelivered += sent.undelivered;
  }
  return {.network = network,
          .kilobytes = kilobytes,
          .seeds = {request.first_seed, request.last_seed},
          .messages = ms.size() + undelivered,
          .undelivered = undelivered,
          .ms = {mean(ms), percentile(ms, 0.5), percentile(ms, 0.95)}};
}

ApAr accuracy_of(const Scorer& scorer, std::size_t level, bool sampled) {
  const auto a = scorer.score(level, sampled);
  if (!a) return {};
  return {a->ap, a->ar};
}

std::vector<LevelRow> level_rows(const Request& request) {
  const eval::Profile profile = eval::default_profile();
  std::vector<LevelRow> rows;
  for (std::size_t level = 0; level < profile.levels.size(); ++level) {
    LevelRow row{.level = level,
                 .name = profile.level_names[level],
                 .raw = accuracy_of(request.scorer, level, false),
                 .sampled = accuracy_of(request.scorer, level, true),
                 .lost_by_sampling = {},
                 .median_ms = to_ms(profile.levels[level].median),
                 .p95_ms = to_ms(profile.levels[level].p95)};
    if (row.raw.ap && row.sampled.ap) row.lost_by_sampling = 1 - *row.sampled.ap / *row.raw.ap;
    rows.push_back(std::move(row));
  }
  return rows;
}

}  // namespace

void run_fig_adjust(const Request& request, Document& document) {
  const std::vector<LevelRow> levels = level_rows(request);
  document.tables.push_back(
      {"levels",
       "(a) Accuracy and (b) time of the levels, on raw images",
       "COCO AP and AR (IoU .50:.95, area all, maxDets 100) over the 795 frames of the demo video; "
       "run times as recorded, one thread. L0: yolo-fastest 1.1 at 224x224, L2 and L4: yolox-nano "
       "at 256x192 and 416x320.",
       {{"/level", "level"},
        {"/name", "model"},
        {"/raw/ap", "AP", 3},
        {"/raw/ar", "AR", 3},
        {"/median_ms", "median, ms", 1},
        {"/p95_ms", "p95, ms", 1}},
       levels});
  document.tables.push_back({"inputs",
                             "(c) Accuracy on raw and sampled images",
                             "Raw: 512 KB; sampled: every second pixel per axis, 128 KB. "
                             "The paper loses 4 to 8 %.",
                             {{"/level", "level"},
                              {"/name", "model"},
                              {"/raw/ap", "AP raw", 3},
                              {"/sampled/ap", "AP sampled", 3},
                              {"/lost_by_sampling", "lost, %", 1, true},
                              {"/raw/ar", "AR raw", 3},
                              {"/sampled/ar", "AR sampled", 3}},
                             levels});
  std::vector<TransmissionRow> rows;
  for (const char* network : kNetworks) {
    for (const std::size_t kilobytes : kKilobytes) {
      rows.push_back(transmission_row(request, network, kilobytes));
    }
  }
  document.tables.push_back(
      {"transmission",
       "(d) Transmission time of a message, uplink, while driving",
       "One message every 2 s through the production endpoints, alone on its link.",
       {{"/network", "network"},
        {"/kilobytes", "KB"},
        {"/ms/p50", "p50, ms", 1},
        {"/ms/mean", "mean, ms", 1},
        {"/ms/p95", "p95, ms", 1},
        {"/messages", "messages"},
        {"/undelivered", "not within 2 s"}},
       std::move(rows)});
}

}  // namespace interneuron::experiments
