#include "app/offload/road.h"

#include <spdlog/spdlog.h>

#include <cstdio>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <thread>

#include "app/offload/offload_request.h"
#include "app/watch/publisher.h"
#include "core/base/statistics.h"
#include "host/process/failure.h"
#include "host/settings/data.h"
#include "host/settings/link_options.h"
#include "interneuron/node.h"
#include "perception/detector.h"
#include "perception/frame_source.h"

namespace interneuron::cli {
namespace {

namespace perc = perception;

// Pictures of the calibration: enough for the background models to settle; chosen.
constexpr int kCalibrationPictures = 30;
// Between two runs of the calibration, as between two images of a camera; chosen.
constexpr Duration kCalibrationPause = std::chrono::milliseconds(40);
// Run times in operation that are remembered per level, and how many make a percentile; chosen.
constexpr std::size_t kObserved = 40;
constexpr std::size_t kEnoughObserved = 3;

std::vector<perc::Image> calibration_pictures(const RoadOptions& options,
                                              const std::optional<std::filesystem::path>& data) {
  perc::FrameSource source(options.video.empty() ? default_video(data) : options.video);
  std::vector<perc::Image> pictures;
  while (pictures.size() < kCalibrationPictures) {
    const auto frame = source.next();
    if (!frame) break;
    pictures.push_back(perc::make_variant(frame->bgr, static_cast<std::uint32_t>(frame->index),
                                          perc::Variant::kRaw));
  }
  return pictures;
}

std::optional<perc::Ladder> ladder_of(const RoadOptions& options,
                                      const std::optional<std::filesystem::path>& data) {
  if (options.ladder == kNoLadder) return std::nullopt;
  return perc::make_ladder({.kind = *perc::parse_ladder_kind(options.ladder),
                            .data_dir = data.value_or(std::filesystem::path()),
                            .budget = ladder_budget(from_ms(options.deadline_ms)),
                            .max_levels = 0,
                            .spend = {}});
}

class Road {
 public:
  Road(const RoadOptions& options, RoadHooks& hooks);
  int run();

 private:
  // An image that waits for the one worker. Its level is chosen when that takes it: what it waited
  // counts.
  struct Job {
    Delivered delivered;  // without its payload
    perc::Image image;
    std::size_t top = 0;
    std::size_t level = 0;
    TimePoint arrived{};
    TimePoint began{};

    Job without_image() const { return {delivered, {}, top, level, arrived, began}; }
  };

  NodeOptions node_options() const;
  void tell_ready() const;
  std::unique_ptr<StampService> serve_stamp() const;
  void calibrate();
  void serve(Delivered delivered);
  void start_next();
  void enqueue(Job job);
  std::size_t choose_level(const Job& job);
  std::size_t top_level(PeerId peer, Duration budget);
  Duration p95(std::size_t level) const;
  void observe(std::size_t level, Duration time);
  Node::Task detect(const Job& job);
  void detected(const Job& job, Duration took, Bytes result);

  const RoadOptions& options_;
  RoadHooks& hooks_;
  std::optional<std::filesystem::path> data_;
  std::optional<perc::Ladder> ladder_;            // nothing: only answers those who measure
  std::vector<LevelProfile> levels_;              // of ladder_, as calibrated
  std::vector<std::vector<double>> observed_ms_;  // per level, the newest kObserved
  std::deque<Job> waiting_;
  bool computing_ = false;
  Node node_;
  LinkPublisher links_;
  std::map<PeerId, std::size_t> top_;
  std::uint64_t malformed_ = 0;
  std::uint64_t served_ = 0;
};

Road::Road(const RoadOptions& options, RoadHooks& hooks)
    : options_(options),
      hooks_(hooks),
      data_(find_data(options.data)),
      ladder_(ladder_of(options, data_)),
      node_(node_options()),
      links_(node_, "road") {}

NodeOptions Road::node_options() const {
  NodeOptions o;
  append_links(options_.nics, LinkPeer::kNone, o);
  for (NodeLink& link : o.links) link.local_address = options_.address;
  o.port = options_.port;
  o.accept_peers = true;
  o.max_peers = options_.max_peers;
  o.insecure = options_.insecure;
  hooks_.configure(o);
  return o;
}

std::unique_ptr<StampService> Road::serve_stamp() const {
  if (options_.stamp.port == 0) return nullptr;
  StampOptions stamp = options_.stamp;
  stamp.insecure = options_.insecure;
  std::vector<std::string> nics;
  for (const std::string& text : options_.nics) {
    nics.push_back(parse_link_option(text, LinkPeer::kNone).nic);
  }
  return std::make_unique<StampService>(stamp, nics, options_.address);
}

void Road::calibrate() {
  observed_ms_.resize(ladder_->size());
  if (const auto known = hooks_.levels(); known.size() == ladder_->size()) {
    levels_.assign(known.begin(), known.end());
    return;
  }
  const auto pictures = calibration_pictures(options_, data_);
  spdlog::info("calibrating on {} pictures, {} runs per level", pictures.size(),
               options_.calibration_runs);
  ladder_->calibrate(
      pictures, options_.calibration_runs,
      [](const perc::Level& level, std::size_t done, std::size_t total) {
        spdlog::info("level {} of {}: {}: median {:.1f} ms, p95 {:.1f} ms", done, total, level.name,
                     to_ms(level.r_median), to_ms(level.r_p95));
      },
      kCalibrationPause);
  spdlog::info("{}", ladder_->description());
  for (std::size_t i = 0; i < ladder_->size(); ++i) {
    const perc::Level& level = ladder_->level(i);
    levels_.push_back({level.r_median, level.r_p95, level.quality});
  }
}

// The calibration's, or that of the newest images if those took longer: in operation other programs
// share the processor.
Duration Road::p95(std::size_t level) const {
  const std::vector<double>& times = observed_ms_[level];
  Duration worst = levels_[level].p95;
  if (times.size() >= kEnoughObserved) worst = std::max(worst, from_ms(percentile(times, 0.95)));
  return worst;
}

void Road::observe(std::size_t level, Duration time) {
  std::vector<double>& times = observed_ms_[level];
  times.push_back(to_ms(time));
  if (times.size() > kObserved) times.erase(times.begin());
}

// The highest level that fits what the vehicle can afford; it refines that during its first rounds.
std::size_t Road::top_level(PeerId peer, Duration budget) {
  if (options_.top_level >= 0) {
    return std::min(static_cast<std::size_t>(options_.top_level), ladder_->size() - 1);
  }
  std::size_t level = 0;
  for (std::size_t i = 0; i < ladder_->size(); ++i) {
    if (p95(i) <= budget) level = i;
  }
  const auto known = top_.find(peer);
  if (known != top_.end() && known->second == level) return level;
  spdlog::info("vehicle {}: {:.1f} ms for the computation, top level {} ({})", peer.value,
               to_ms(budget), level, ladder_->level(level).name);
  top_[peer] = level;
  return level;
}

void Road::serve(Delivered delivered) {
  const auto request = parse_request(delivered.payload);
  std::optional<perc::Image> image;
  if (request) image = perc::decode_image(request->second);
  if (!image) {
    ++malformed_;
    return;
  }
  const std::size_t top = top_level(delivered.from, request->first);
  delivered.payload.clear();
  Job job{std::move(delivered), std::move(*image), top, 0, node_.now(), {}};
  const Duration pause = hooks_.before_compute(job.delivered.round.round);
  if (pause <= Duration{}) return enqueue(std::move(job));
  node_.after(pause, [this, job = std::move(job)] { enqueue(job); });
}

void Road::enqueue(Job job) {
  waiting_.push_back(std::move(job));
  start_next();
}

// The one detector of a level is used by one job at a time.
void Road::start_next() {
  // Behind a backlog this long nobody waits for the answer any more.
  std::erase_if(waiting_, [now = node_.now()](const Job& job) {
    return now - job.arrived > job.delivered.deadline;
  });
  if (computing_ || waiting_.empty()) return;
  computing_ = true;
  Job job = std::move(waiting_.front());
  waiting_.pop_front();
  job.level = choose_level(job);
  job.began = node_.now();
  node_.compute(Queue::kComputation, [this, job = std::move(job)] { return detect(job); });
}

// By the guard that the round asks for; a --top-level binds every guard.
std::size_t Road::choose_level(const Job& job) {
  std::span<const LevelProfile> levels = levels_;
  if (options_.top_level >= 0) levels = levels.first(job.top + 1);
  if (const auto level = hooks_.level(levels, job.arrived, node_.now())) return *level;
  return node_.begin_computation(job.delivered.round, levels, job.top);
}

// On the worker.
Node::Task Road::detect(const Job& job) {
  const TimePoint start = node_.now();
  perc::Result result;
  result.boxes = ladder_->detect(job.level, job.image);
  const Duration pause = hooks_.inside_compute(job.delivered.round.round);
  if (pause > Duration{}) std::this_thread::sleep_for(pause);
  result.frame = job.image.frame;
  result.draw_score = ladder_->level(job.level).draw_score;
  result.level = static_cast<std::uint8_t>(job.level);
  result.variant = job.image.variant;
  result.source = job.image.source;
  const Verdict& verdict = job.delivered.verdict;
  result.stage1_late = verdict.late;
  result.stage1_released = verdict.released_at_deadline;
  result.stage1_overrun = std::chrono::duration_cast<std::chrono::microseconds>(verdict.overrun);
  const Duration took = node_.now() - start;
  result.compute_time = std::chrono::duration_cast<std::chrono::microseconds>(took);
  return [this, took, done = job.without_image(), bytes = perc::encode_result(result)] {
    detected(done, took, bytes);
  };
}

void Road::detected(const Job& job, Duration took, Bytes result) {
  ++served_;
  const Delivered& delivered = job.delivered;
  hooks_.computed({delivered.round.round, delivered.variant, job.level, delivered.degraded,
                   job.arrived, job.began, node_.now()});
  if (hooks_.levels().empty()) observe(job.level, took);
  node_.submit(delivered.round, {std::move(result)}, MessageClass::kResult, delivered.from);
  computing_ = false;
  start_next();
}

int Road::run() {
  for (const std::string& warning : node_.warnings()) spdlog::warn("{}", warning);
  const auto stamp = serve_stamp();
  if (ladder_) {
    calibrate();
    node_.on_delivered([this](Delivered d) { serve(std::move(d)); });
  }
  node_.on_peer_ready([](PeerReady e) { spdlog::info("vehicle {}: here", e.peer.value); });
  node_.on_peer_lost([this](PeerLost e) {
    spdlog::info("vehicle {}: silent, forgotten", e.peer.value);
    top_.erase(e.peer);
  });
  node_.stop_on_signals();
  tell_ready();
  node_.run();
  if (ladder_) {
    std::vector<std::string> names;
    for (std::size_t i = 0; i < ladder_->size(); ++i) names.push_back(ladder_->level(i).name);
    hooks_.finished(ladder_->description(), names, levels_);
  }
  spdlog::info("served {} images{}", served_,
               malformed_ > 0 ? ", dropped " + std::to_string(malformed_) + " that were none" : "");
  return kFine;
}

// For programs that start us: what runs, then that vehicles may come.
void Road::tell_ready() const {
  for (std::size_t i = 0; ladder_ && i < ladder_->size(); ++i) {
    std::printf("level %zu %lld %s\n", i,
                static_cast<long long>(ladder_->level(i).r_median.count()),
                ladder_->level(i).name.c_str());
  }
  std::printf("ladder %s\n", ladder_ ? ladder_->description().c_str() : kNoLadder);
  std::string where;
  for (const Statistics::Link& link : node_.statistics().links) {
    const auto address = node_.local_address(link.id);
    where += " " + link.nic + (address ? "=" + to_string(*address) : "");
  }
  std::printf("ready%s\n", where.c_str());
  std::fflush(stdout);
}

}  // namespace

int run_road(const RoadOptions& options, RoadHooks* hooks) {
  if (options.ladder != kNoLadder && !perc::parse_ladder_kind(options.ladder)) {
    throw Failure(kUsage,
                  "--ladder '" + options.ladder + "': give auto, dnn, motion, replay or none");
  }
  if (options.nics.empty()) throw Failure(kUsage, "no NIC: give --nic NAME, once per card");
  RoadHooks none;
  return Road(options, hooks != nullptr ? *hooks : none).run();
}

}  // namespace interneuron::cli
