#include "app/offload/vehicle.h"

#include <spdlog/spdlog.h>

#include <atomic>
#include <cstdio>
#include <optional>

#include "app/computing/computation_budget.h"
#include "app/computing/no_answer.h"
#include "app/offload/camera.h"
#include "app/offload/run_record.h"
#include "app/offload/submit_log.h"
#include "app/offload/vehicle_run.h"
#include "app/perception/detector.h"
#include "app/process/failure.h"
#include "app/process/signals.h"
#include "app/process/status_line.h"
#include "app/records/run_files.h"
#include "app/settings/data.h"
#include "app/settings/link_options.h"
#include "app/watch/publisher.h"
#include "app/watch/time_keeper.h"
#include "app/watch/trust_keeper.h"
#include "interneuron/node.h"
#include "node/io/steady_clock.h"

namespace interneuron::offload {
namespace {

namespace perc = perception;
using namespace std::chrono_literals;

constexpr PipelineId kCamera{0};
// After the roadside unit has answered, links are measured for at most this long before the first
// round, and looked at so often.
constexpr Duration kSettle = 2s;
constexpr Duration kSettlePoll = 20ms;
// Time between two progress lines.
constexpr Duration kProgress = 500ms;

// The program `vehicle`: a camera, a Node, the local backup and the record of the rounds. A round
// begins every period; its image goes out, the backup computes on a worker, and the first answer
// ends it. All else runs on the Node's thread. run() returns after the last round or a signal.
class Vehicle {
 public:
  Vehicle(const VehicleOptions& options, VehicleHooks& hooks);
  int run();

 private:
  NodeOptions node_options();
  PipelineConfig pipeline() const;
  double backup_quality() const;
  void wait_for_roadside();
  void settle(TimePoint until);
  void start();
  void begin_round(TimePoint planned_at);
  void send(const RoundRef& ref, const Camera::Shot& shot);
  void submit(const RoundRef& ref, Variants variants);
  void back_up(const RoundRef& ref, const perc::Image& image);
  void planned(const Planned& event);
  void refused(const Planned& event);
  void done(const RoundDone& event);
  void heard(const Message& message);
  void finish();
  void progress();

  const VehicleOptions& o_;
  VehicleHooks& hooks_;
  perc::Images images_;
  settings::Credentials credentials_;
  std::optional<std::filesystem::path> data_;
  std::string video_;
  Camera camera_;
  perc::Ladder backup_;
  Node node_;
  watch::LinkPublisher links_;
  watch::TimeKeeper time_;
  watch::TrustKeeper trust_;
  std::atomic<std::uint32_t> newest_round_{0};
  // Measured before the loop runs, which it would hold up.
  Encoding encoding_;
  computing::ComputationBudget budget_;
  bool started_ = false;
  bool all_begun_ = false;
  process::StatusLine line_;
  RunRecord record_;
  // The newest reason for which the policy sent nothing.
  std::string refusal_;
  SubmitLog submitted_{"image"};
  std::string failure_;
};

Vehicle::Vehicle(const VehicleOptions& options, VehicleHooks& hooks)
    : o_(options),
      hooks_(hooks),
      images_(*perc::parse_images(options.images)),
      credentials_(options.keys, settings::Trusts::kThePeer),
      data_(settings::find_data(options.data)),
      video_(options.video.empty() ? settings::default_video(data_) : options.video),
      camera_(video_, options.rounds > 0),
      backup_(local_ladder(options, data_, 1)),
      node_(node_options()),
      links_(node_, "vehicle"),
      // Detections of this program are local backups.
      time_(node_, credentials_, Queue::kComputation),
      trust_(node_, credentials_, Queue::kComputation),
      encoding_(encoding_of(images_)),
      budget_(from_ms(options.deadline_ms)),
      record_({.rounds = options.rounds,
               .guard = options.guard,
               .out = options.out,
               .judged = truth_of(options, data_, video_).has_value()}) {}

PipelineConfig Vehicle::pipeline() const {
  PipelineConfig p{
      .id = kCamera,
      .stages = offload_stages(),
      .deadline = from_ms(o_.deadline_ms),
      .period = from_ms(o_.period_ms),
      .policy = o_.policy.empty() ? default_policy(images_) : o_.policy,
      .guard = o_.guard == to_string(GuardKind::kPaper) ? GuardKind::kPaper : GuardKind::kBudget};
  p.fallback.local = backup_quality();
  p.beta_permille = static_cast<std::int16_t>(o_.beta * 1000);
  // The smaller one of the paper's images is worth nearly as much at every level, so that results
  // tell enough; what each of four JPEGs is worth has to be known.
  if (images_ == perc::Images::kJpeg) {
    p.levels = believed_levels(local_ladder(o_, data_, 0), images_);
  }
  hooks_.configure(p);
  return p;
}

// The quality of the backup's level on a raw image; 0 where nobody knows it.
double Vehicle::backup_quality() const {
  const std::vector<double>& quality = backup_.level(0).quality;
  return quality.empty() ? 0 : quality.front();
}

NodeOptions Vehicle::node_options() {
  NodeOptions n;
  settings::append_links(o_.links, settings::LinkPeer::kNamed, n);
  n.port = o_.port;
  n.transport = settings::transport_kind(o_.transport);
  n.pipelines = {pipeline()};
  credentials_.apply(n);
  hooks_.configure(n);
  return n;
}

// --- start-up

void Vehicle::wait_for_roadside() {
  node_.on_peer_ready([this](PeerReady) {
    if (!started_) settle(node_.now() + kSettle);
  });
  node_.after(from_ms(o_.wait_s * 1000), [this] {
    if (started_ || !failure_.empty()) return;
    char wait[32];
    std::snprintf(wait, sizeof wait, "%g", o_.wait_s);
    failure_ = std::string("no roadside unit answered within ") + wait + " s at";
    for (const std::string& link : o_.links) failure_ += " " + link;
    failure_ += "; is `interneuron road` running there, the port open";
    failure_ +=
        o_.keys.insecure ? ", and both without keys?" : ", and does each trust the other's key?";
    node_.stop();
  });
}

// Rounds begin when every link that is up has a rate and a round trip, or when the time is over.
void Vehicle::settle(TimePoint until) {
  if (started_) return;
  const auto links = node_.links(*node_.peer());
  const bool measured = std::ranges::all_of(links, [](const LinkState& l) {
    return l.up && l.rate.bits_per_second > 0 && l.rtt_p50 > Duration::zero();
  });
  if (!measured && node_.now() < until) {
    node_.after(kSettlePoll, [this, until] { settle(until); });
    return;
  }
  for (const LinkState& l : links) {
    spdlog::info("link {}: {}, round trip {:.1f} ms, {:.1f} Mbit/s up", links_.name(l.id),
                 l.up ? "up" : "silent", to_ms(l.rtt_p50), l.rate.mbit());
  }
  // The images are made before they can leave; that is part of the round too.
  budget_.estimate(links, encoding_.time, encoding_.bytes, perc::kMaxResultBytes);
  start();
}

void Vehicle::start() {
  started_ = true;
  spdlog::info("deadline {:.0f} ms, {:.1f} ms of it for the computation", o_.deadline_ms,
               to_ms(budget_.value()));
  camera_.fetch(node_);
  const TimePoint first = node_.now() + from_ms(o_.period_ms);
  node_.at(first, [this, first] { begin_round(first); });
  node_.after(kProgress, [this] { progress(); });
}

// --- rounds

void Vehicle::begin_round(TimePoint planned_at) {
  // The round of a slow source begins when its frame is there.
  if (camera_.fetching()) {
    camera_.when_fetched([this, planned_at] { begin_round(planned_at); });
    return;
  }
  const auto shot = camera_.take();
  if (!shot || (o_.rounds > 0 && record_.begun() >= o_.rounds)) {
    all_begun_ = true;
    finish();
    return;
  }
  const RoundRef ref = node_.begin_round(kCamera);
  newest_round_ = ref.round.value;
  record_.begun(ref.round.value, shot->frame);

  send(ref, *shot);
  back_up(ref, shot->raw);

  camera_.fetch(node_);
  const TimePoint next = planned_at + from_ms(o_.period_ms);
  node_.at(next, [this, next] { begin_round(next); });
}

// JPEGs are made on a worker, beside the local backup: the loop would be held up by them. A round
// that gives way to the next one before its turn comes is not sent.
void Vehicle::send(const RoundRef& ref, const Camera::Shot& shot) {
  const Duration budget = budget_.value();
  if (images_ == perc::Images::kPaper) return submit(ref, encoded(shot, images_, budget));
  node_.compute(Queue::kComputation, [this, ref, shot, budget]() -> Node::Task {
    if (newest_round_ != ref.round.value) return {};
    return [this, ref, variants = encoded(shot, images_, budget)]() mutable {
      submit(ref, std::move(variants));
    };
  });
}

void Vehicle::submit(const RoundRef& ref, Variants variants) {
  submitted_.submitted(ref, node_.submit(ref, hooks_.submitted(ref, std::move(variants)),
                                         MessageClass::kData, node_.peer()));
}

// Computes the lowest level on this host, beside the remote computation. A backup that still waits
// or runs when the next round begins is abandoned.
void Vehicle::back_up(const RoundRef& ref, const perc::Image& image) {
  if (!hooks_.local_backup()) return;
  node_.compute(Queue::kLocalBackup, [this, ref, image]() -> Node::Task {
    if (newest_round_ != ref.round.value) return {};
    perc::Result result{.boxes = backup_.detect(0, image)};
    if (newest_round_ != ref.round.value) return {};
    result.frame = image.frame;
    result.draw_score = backup_.level(0).draw_score;
    result.source = image.source;
    return [this, ref, bytes = perc::encode_result(result)] { node_.local_result(ref, bytes); };
  });
}

void Vehicle::planned(const Planned& event) {
  if (event.stage != 1) return;
  const std::span<const perc::Variant> variants = perc::variants_of(images_);
  std::string text;
  for (const Assignment& a : event.plan.sends) {
    if (a.role == SendRole::kParity || a.role == SendRole::kShadow) continue;
    if (!text.empty()) text += ' ';
    text += std::string(perc::to_string(variants[a.variant])) + ":" + links_.name(a.link);
  }
  if (event.plan.under_floor) text += " (under floor)";
  if (!event.plan.refused.empty()) {
    text = records::kRefusedPlan;
    refused(event);
  }
  record_.planned(event.round.round.value, text);
}

// Warns once per reason in a row, since a policy may refuse every round for the same one.
void Vehicle::refused(const Planned& event) {
  if (event.plan.refused == refusal_) return;
  refusal_ = event.plan.refused;
  spdlog::warn("round {}: {}", event.round.round.value, refusal_);
}

void Vehicle::done(const RoundDone& event) {
  const records::RoundRow row = record_.done(event, from_ms(o_.deadline_ms));
  // The larger one of the paper's images counts, and whichever JPEG there was time for.
  const bool counts = row.road && (images_ == perc::Images::kJpeg ||
                                   row.road->variant == perc::to_string(perc::Variant::kRaw));
  if (counts) budget_.learn(row.e2e - row.road->compute);
  hooks_.done(event, row);
  finish();
}

// The roadside unit says that a round gets no result: its local one is the answer then.
void Vehicle::heard(const Message& message) {
  if (message.channel != computing::kNoAnswerChannel || message.peer != node_.peer()) return;
  const auto unanswered = computing::parse_no_answer(message.bytes);
  if (unanswered) node_.give_up(unanswered->round);
}

void Vehicle::finish() {
  if (all_begun_ && record_.decided() == record_.begun()) node_.stop();
}

void Vehicle::progress() {
  if (!o_.quiet) show_progress(line_, record_.counts(), o_.rounds, false);
  node_.after(kProgress, [this] { progress(); });
}

int Vehicle::run() {
  for (const std::string& warning : credentials_.warnings()) spdlog::warn("{}", warning);
  for (const std::string& warning : node_.warnings()) spdlog::warn("{}", warning);
  record_.open();
  spdlog::info("local backup: {}", backup_.level(0).name);
  node_.on_planned([this](Planned e) { planned(e); });
  node_.on_round_done([this](RoundDone e) { done(e); });
  node_.on_message([this](Message m) { heard(m); });
  node_.on_peer_restarted([](PeerRestarted) { spdlog::warn("the roadside unit restarted"); });
  node_.stop_on_signals();
  wait_for_roadside();
  node_.run();
  // What was measured is written, even after a second Ctrl-C.
  const process::SignalWatch undisturbed;
  if (started_ && !o_.quiet) show_progress(line_, record_.counts(), o_.rounds, true);
  if (!failure_.empty()) throw process::Failure(process::kFailed, failure_);
  const int signal = node_.stopped_by_signal();
  // Rounds that the signal cut off are no rounds of the run.
  if (signal != 0) record_.drop_undecided();
  hooks_.finished(node_.statistics().links);
  const VehicleRun run{data_, video_, backup_.description()};
  // Without a round there is nothing to tell, and a picture of nothing helps nobody.
  const bool told = started_ && (signal == 0 || record_.decided() > 0);
  const int code = told ? report_run(o_, run, record_, node_.statistics()) : process::kFine;
  return signal != 0 ? 128 + signal : code;
}

}  // namespace

int run_vehicle(const VehicleOptions& options, VehicleHooks* hooks) {
  if (!perc::parse_ladder_kind(options.ladder)) {
    throw process::Failure(process::kUsage,
                           "--ladder '" + options.ladder + "': give auto, dnn, motion or replay");
  }
  if (!perc::parse_images(options.images)) {
    throw process::Failure(process::kUsage,
                           "--images '" + options.images + "': give paper or jpeg");
  }
  if (options.links.empty()) {
    throw process::Failure(process::kUsage, "no link: give --link NIC=ADDRESS:PORT, once per card");
  }
  // Mistakes in the links are found before anything is opened.
  NodeOptions checked;
  settings::append_links(options.links, settings::LinkPeer::kNamed, checked);
  VehicleHooks none;
  return Vehicle(options, hooks != nullptr ? *hooks : none).run();
}

}  // namespace interneuron::offload
