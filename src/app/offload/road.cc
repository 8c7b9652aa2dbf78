#include "app/offload/road.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cstdio>
#include <exception>
#include <map>
#include <thread>

#include "app/computing/roadside_unit.h"
#include "app/offload/offload_request.h"
#include "app/offload/submit_log.h"
#include "app/perception/codec.h"
#include "app/process/failure.h"
#include "app/settings/data.h"
#include "app/settings/link_options.h"
#include "app/watch/publisher.h"
#include "app/watch/time_keeper.h"
#include "app/watch/trust_keeper.h"
#include "interneuron/node.h"

namespace interneuron::offload {
namespace {

namespace perc = perception;

// The least time between two lines about the same vehicle in the log.
constexpr Duration kBetweenLines = std::chrono::seconds(1);
// Lines about vehicles in the log in each second: whoever comes again and again under new sessions
// is a new vehicle each time. No measurement behind it: a fleet that joins at once fits.
constexpr int kLinesPerSecond = 100;
// How long a vehicle may be told that it gets no answer. Later the deadline of its round has told
// it; lost, nothing is missing but time.
constexpr Duration kTellWithin = std::chrono::milliseconds(100);

// The program `road`: one Node that serves every vehicle that comes, and the detectors. The Node's
// thread hands images over and results back; decoding and detection run on a worker, one image at a
// time, and nothing else touches the detectors. What arrives was sent by anybody: the unit divides
// the worker's time between vehicles, and what is no image, cannot be decoded in time or comes too
// often is counted for its vehicle, which is told so. run() returns after a signal.
class Road {
 public:
  Road(const RoadOptions& options, RoadHooks& hooks);
  int run();

 private:
  // An input is the whole message, not decoded yet.
  using Unit = computing::RoadsideUnit<Bytes>;
  // What is remembered of a vehicle for the log.
  struct Vehicle {
    std::size_t top = 0;
    TimePoint logged{};
  };

  NodeOptions node_options() const;
  void tell_ready() const;
  std::unique_ptr<StampService> serve_stamp() const;
  void prepare();
  // Whether one more line about a vehicle fits into this second. How many did not is told with the
  // first one that fits again.
  bool may_log();
  void serve(Delivered delivered);
  std::size_t top_level(PeerId peer, Duration budget);
  void lost(PeerId peer);
  void forget(PeerId peer);
  void enqueue(Unit::Job job);
  void start_next();
  std::size_t level_of(const Unit::Job& job);
  Node::Task compute(const Unit::Job& job, std::size_t level);
  Node::Task detect(const Unit::Job& job, std::size_t level);
  void detected(Duration took, Bytes result);
  void undecoded();
  void tell_unanswered();
  void tell_served() const;

  const RoadOptions& options_;
  RoadHooks& hooks_;
  settings::Credentials credentials_;
  std::optional<std::filesystem::path> data_;
  // Nothing when the unit only answers those who measure; then there is no unit_ either.
  std::optional<perc::Ladder> ladder_;
  std::vector<LevelProfile> levels_;
  std::optional<Unit> unit_;
  Node node_;
  watch::LinkPublisher links_;
  watch::TimeKeeper time_;
  watch::TrustKeeper trust_;
  SubmitLog results_{"result"};
  std::map<PeerId, Vehicle> vehicles_;
  // When the newest second of the log began, and its lines so far.
  TimePoint second_{};
  int lines_ = 0;
  // When start_next() is called to end what is late.
  std::optional<TimePoint> timer_;
};

Road::Road(const RoadOptions& options, RoadHooks& hooks)
    : options_(options),
      hooks_(hooks),
      credentials_(options.keys, settings::Trusts::kMany),
      data_(settings::find_data(options.data)),
      ladder_(road_ladder(options, data_)),
      node_(node_options()),
      links_(node_, "road"),
      // This program has no local backup.
      time_(node_, credentials_, Queue::kLocalBackup),
      trust_(node_, credentials_, Queue::kLocalBackup) {}

NodeOptions Road::node_options() const {
  NodeOptions o;
  settings::append_links(options_.nics, settings::LinkPeer::kNone, o);
  for (NodeLink& link : o.links) link.local_address = options_.address;
  o.port = options_.port;
  o.transport = settings::transport_kind(options_.transport);
  o.accept_peers = true;
  o.max_peers = options_.max_peers;
  o.shards = options_.shards;
  o.relays = options_.relays;
  credentials_.apply(o);
  hooks_.configure(o);
  return o;
}

std::unique_ptr<StampService> Road::serve_stamp() const {
  if (options_.stamp.port == 0) return nullptr;
  std::vector<std::string> nics;
  for (const std::string& text : options_.nics) {
    nics.push_back(settings::parse_link_option(text, settings::LinkPeer::kNone).nic);
  }
  return std::make_unique<StampService>(options_.stamp, nics, options_.address);
}

// What the hooks know of the levels is taken as it is and not measured.
void Road::prepare() {
  const auto known = hooks_.levels();
  if (known.size() == ladder_->size()) {
    levels_.assign(known.begin(), known.end());
  } else {
    levels_ = calibrated(*ladder_, options_, data_);
  }
  std::optional<std::size_t> top_level;
  if (options_.top_level >= 0) top_level = static_cast<std::size_t>(options_.top_level);
  unit_.emplace(levels_, top_level);
  links_.add_work([this](PeerId peer) { return unit_->work(peer); });
}

bool Road::may_log() {
  if (const TimePoint now = node_.now(); now - second_ >= std::chrono::seconds(1)) {
    if (lines_ > kLinesPerSecond) {
      spdlog::warn("{} lines about vehicles were left out", lines_ - kLinesPerSecond);
    }
    second_ = now;
    lines_ = 0;
  }
  return ++lines_ <= kLinesPerSecond;
}

// By what the vehicle can afford, which it refines during its first rounds.
std::size_t Road::top_level(PeerId peer, Duration budget) {
  const std::size_t level = unit_->top_level(peer, budget);
  const auto [known, is_new] = vehicles_.try_emplace(peer);
  Vehicle& vehicle = known->second;
  const bool changed = is_new || vehicle.top != level;
  if (options_.top_level >= 0 || !changed) return level;
  vehicle.top = level;
  if (!is_new && node_.now() - vehicle.logged < kBetweenLines) return level;
  if (!may_log()) return level;
  vehicle.logged = node_.now();
  spdlog::info("vehicle {}: {:.1f} ms for the computation, top level {} ({})", peer.value,
               to_ms(budget), level, ladder_->level(level).name);
  return level;
}

void Road::serve(Delivered delivered) {
  Bytes input = std::move(delivered.payload);
  delivered.payload = {};
  const auto request = parse_request(input);
  if (!request || !perc::may_be_image(request->second)) {
    unit_->reject(delivered);
    return tell_unanswered();
  }
  const std::size_t top = top_level(delivered.from, request->first);
  Unit::Job job{std::move(delivered), node_.now(), top, std::move(input)};
  const Duration pause = hooks_.before_compute(job.message.round.round);
  if (pause <= Duration{}) return enqueue(std::move(job));
  node_.after(pause, [this, job = std::move(job)] { enqueue(job); });
}

void Road::enqueue(Unit::Job job) {
  unit_->add(std::move(job));
  start_next();
}

void Road::start_next() {
  const TimePoint now = node_.now();
  if (timer_ && *timer_ <= now) timer_.reset();
  if (const Unit::Job* next = unit_->next(now)) {
    const std::size_t level = level_of(*next);
    auto job = std::make_shared<const Unit::Job>(unit_->begin(now, level));
    node_.compute(Queue::kComputation,
                  [this, level, job = std::move(job)] { return compute(*job, level); });
  }
  tell_unanswered();
  const auto due = unit_->next_timeout();
  if (!due || (timer_ && *timer_ <= *due)) return;
  timer_ = due;
  node_.at(*due, [this] { start_next(); });
}

// By the hooks' rule, else by the guard that the round asks for, among the levels that fit into the
// vehicle's part of the worker's time; their profiles tell what they are worth on the paper's
// images.
std::size_t Road::level_of(const Unit::Job& job) {
  if (const auto level = hooks_.level(unit_->levels(), job.delivered, node_.now())) return *level;
  const auto known = unit_->levels(job.message.from, node_.now());
  std::vector<LevelProfile> levels(known.begin(), known.end());
  const auto images = perc::images_of(*perc::claimed_variant(parse_request(job.input)->second));
  if (images != perc::Images::kPaper) {
    for (std::size_t i = 0; i < levels.size(); ++i) {
      levels[i].quality = ladder_->level(i).quality_on(images);
    }
  }
  return node_.begin_computation(job.message.round, levels, std::min(job.top, levels.size() - 1));
}

// Runs on the worker. What the image of one vehicle makes libraries throw ends its job and nobody
// else's.
Node::Task Road::compute(const Unit::Job& job, std::size_t level) {
  try {
    return detect(job, level);
  } catch (const std::exception& e) {
    return [this, peer = job.message.from, why = std::string(e.what())] {
      if (may_log()) spdlog::warn("vehicle {}: an image cannot be computed: {}", peer.value, why);
      undecoded();
    };
  }
}

Node::Task Road::detect(const Unit::Job& job, std::size_t level) {
  auto image = perc::decode_image(parse_request(job.input)->second);
  if (!image) return [this] { undecoded(); };
  image->sender = job.message.from.value;
  const TimePoint start = node_.now();
  perc::Result result{.boxes = ladder_->detect(level, *image)};
  const Duration pause = hooks_.inside_compute(job.message.round.round);
  if (pause > Duration{}) std::this_thread::sleep_for(pause);
  result.frame = image->frame;
  result.draw_score = ladder_->level(level).draw_score;
  result.level = static_cast<std::uint8_t>(level);
  result.variant = image->variant;
  result.source = image->source;
  const Verdict& verdict = job.message.verdict;
  result.stage1_late = verdict.late;
  result.stage1_released = verdict.released_at_deadline;
  result.stage1_overrun = std::chrono::duration_cast<std::chrono::microseconds>(verdict.overrun);
  const Duration took = node_.now() - start;
  result.compute_time = std::chrono::duration_cast<std::chrono::microseconds>(took);
  return [this, took, bytes = perc::encode_result(result)] { detected(took, bytes); };
}

void Road::detected(Duration took, Bytes result) {
  const bool learns = hooks_.levels().empty();
  const computing::Computed computed =
      unit_->end(node_.now(), learns ? std::optional(took) : std::nullopt);
  hooks_.computed(computed);
  results_.submitted(computed.round, node_.submit(computed.round, {std::move(result)},
                                                  MessageClass::kResult, computed.from));
  start_next();
}

void Road::undecoded() {
  unit_->fail(node_.now());
  start_next();
}

// Tells the vehicles which rounds get no result. One that knows nothing of such messages waits for
// its deadline.
void Road::tell_unanswered() {
  while (const auto unanswered = unit_->poll_unanswered()) {
    (void)node_.send(unanswered->from, computing::encode_no_answer(*unanswered),
                     {.deadline = kTellWithin, .channel = computing::kNoAnswerChannel});
    Vehicle& vehicle = vehicles_[unanswered->from];
    if (node_.now() - vehicle.logged < kBetweenLines || !may_log()) continue;
    vehicle.logged = node_.now();
    spdlog::info("vehicle {}: round {} gets no result: {}", unanswered->from.value,
                 unanswered->round.round.value, computing::to_string(unanswered->why));
  }
}

// What a vehicle has left is forgotten, the backgrounds of its scenes by the worker that uses them.
void Road::forget(PeerId peer) {
  vehicles_.erase(peer);
  if (!unit_) return;
  unit_->forget(peer);
  node_.compute(Queue::kComputation, [this, peer]() -> Node::Task {
    ladder_->forget(peer.value);
    return {};
  });
}

void Road::lost(PeerId peer) {
  const computing::PeerWork work = unit_ ? unit_->work(peer) : computing::PeerWork{};
  if (may_log()) {
    spdlog::info("vehicle {}: silent, forgotten; {} images computed, {} without a result",
                 peer.value, work.computed, work.unanswered());
  }
  forget(peer);
}

int Road::run() {
  for (const std::string& warning : credentials_.warnings()) spdlog::warn("{}", warning);
  for (const std::string& warning : node_.warnings()) spdlog::warn("{}", warning);
  const auto stamp = serve_stamp();
  if (ladder_) {
    prepare();
    node_.on_delivered([this](Delivered d) { serve(std::move(d)); });
  }
  node_.on_peer_ready([this](PeerReady e) {
    if (may_log()) spdlog::info("vehicle {}: here", e.peer.value);
  });
  node_.on_peer_lost([this](PeerLost e) { lost(e.peer); });
  node_.on_peer_restarted([this](PeerRestarted e) { forget(e.peer); });
  node_.on_peer_limited([this](PeerLimited e) {
    if (!may_log()) return;
    spdlog::warn("vehicle {}: takes more than it may ({}); what is too much of its own is dropped",
                 e.peer.value, to_string(e.limit));
  });
  node_.stop_on_signals();
  tell_ready();
  node_.run();
  if (ladder_) {
    std::vector<std::string> names;
    for (std::size_t i = 0; i < ladder_->size(); ++i) names.push_back(ladder_->level(i).name);
    hooks_.finished(ladder_->description(), names, levels_);
  }
  tell_served();
  return process::kFine;
}

void Road::tell_served() const {
  const computing::PeerWork work = unit_ ? unit_->total() : computing::PeerWork{};
  std::string served = "served " + std::to_string(work.computed) + " images";
  if (work.crowded_out + work.too_late > 0) {
    served += ", dropped " + std::to_string(work.crowded_out + work.too_late) +
              " that came too fast or too late";
  }
  if (work.unreadable > 0) {
    served += ", refused " + std::to_string(work.unreadable) + " that were none";
  }
  spdlog::info("{}", served);
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
    throw process::Failure(process::kUsage, "--ladder '" + options.ladder +
                                                "': give auto, dnn, motion, replay or none");
  }
  if (options.nics.empty())
    throw process::Failure(process::kUsage, "no NIC: give --nic NAME, once per card");
  if (!options.address.empty() && !make_address(options.address, 0)) {
    throw process::Failure(
        process::kUsage, "--address '" + options.address + "' is no numeric address like 10.0.0.1");
  }
  for (const std::string& relay : options.relays) {
    if (make_address(relay, 0)) continue;
    throw process::Failure(process::kUsage,
                           "--relay '" + relay + "' is no numeric address like 10.0.0.1");
  }
  RoadHooks none;
  return Road(options, hooks != nullptr ? *hooks : none).run();
}

}  // namespace interneuron::offload
