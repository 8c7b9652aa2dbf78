#include "core/link/path_machine.h"

#include <algorithm>
#include <cstdio>

#include "core/base/earliest.h"

namespace interneuron::link {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

// A path is SUSPECT after max(this, 1.5 SRTT, SRTT + 2 RTTVAR) without acknowledgement: three
// intervals of feedback, half a round trip beyond the usual, or what its jitter explains
// (docs/constants.md, "States of a path").
constexpr Duration kSuspectFloor = milliseconds(15);
// A path is PULLED after max(this, SRTT + 4 RTTVAR) of silence: RFC 6298's timeout without its
// floor of a second, and the least that SRT waits before it judges a link (docs/constants.md,
// "States of a path").
constexpr Duration kPulledFloor = milliseconds(60);
// The same while no round trip is known: what is sent first on a path cannot be late yet. No
// measurement behind these values: the first only has to be larger than a radio's round trip
// without a queue, and the second is twice that.
constexpr Duration kSuspectUnknown = milliseconds(200);
constexpr Duration kPulledUnknown = milliseconds(400);
// A queue is long above kQueueLong and over below kQueueShort. A message bears a queue of a quarter
// of its deadline, 60 ms at most; a path does not know the deadlines of its messages, so twice that
// bound makes it SUSPECT.
constexpr Duration kQueueLong = milliseconds(120);
constexpr Duration kQueueShort = milliseconds(60);
// Without data in flight a path is SUSPECT after so many heartbeats: two missing ones and half an
// interval for jitter, so that the third is not awaited.
constexpr double kSuspectHeartbeats = 2.5;
// Without data in flight it is PULLED after so many: at 20 % loss five in a row are lost once in
// 3,000. Nobody waits for data then, so it is not pulled before the longest routine stall of a
// radio (400 to 800 ms; docs/constants.md, "States of a path") with two idle heartbeats lost around
// it.
constexpr int kPulledHeartbeats = 5;
constexpr Duration kIdlePulledFloor = milliseconds(1500);
constexpr double kDeadHeartbeats = 3.5;
// A proof window is clamp(4 SRTT, 1 s, 3 s), as srtla_send has it for bonded cellular links
// (docs/constants.md, "States of a path").
constexpr Duration kLeastProof = seconds(1);
constexpr Duration kMostProof = seconds(3);
// Data packets without an acknowledgement before a path is latched: at 20 % loss all ten are lost
// by chance once in ten million.
constexpr std::uint32_t kUnproven = 10;
// Packets this close together are one burst: when one of them is acknowledged, the loss of the last
// one is no silence. As long as a receiver may delay its feedback (src/core/peers/feedback_due.h).
constexpr Duration kGroup = milliseconds(5);
// PULLED that ended within this was a stall and not an outage. Routine stalls of a radio take 400
// to 800 ms (docs/constants.md, "States of a path").
constexpr Duration kStall = seconds(1);
// Doublings of the silence that pulls a path: 16 times 60 ms are 960 ms, longer than a routine
// stall.
constexpr int kMostPatience = 4;
// One doubling is taken back after this, so that stalls pull a path once a minute at most in the
// long run.
constexpr Duration kForgiven = seconds(60);

Duration times(Duration d, double factor) {
  return Duration{static_cast<std::int64_t>(static_cast<double>(d.count()) * factor)};
}

std::string text(const char* format, Duration a, Duration b) {
  std::array<char, 160> out{};
  std::snprintf(out.data(), out.size(), format, to_ms(a), to_ms(b));
  return out.data();
}

std::int64_t second_of(TimePoint t) {
  return std::chrono::floor<seconds>(t.time_since_epoch()).count();
}

}  // namespace

void PathMachine::Waiting::sent(TimePoint at) {
  if (count_ > 0 && at - at_[(first_ + count_ - 1) % kSize] < kGroup) return;
  if (count_ == kSize) {
    first_ = (first_ + 1) % kSize;
    --count_;
  }
  at_[(first_ + count_++) % kSize] = at;
}

void PathMachine::Waiting::covered(TimePoint sent_at) {
  while (count_ > 0 && since() <= sent_at) {
    first_ = (first_ + 1) % kSize;
    --count_;
  }
}

// --- thresholds

PathMachine::PathMachine() { set_thresholds(); }

void PathMachine::set_thresholds() {
  const Duration srtt = pace_.srtt;
  const Duration rttvar = pace_.rttvar;
  const Duration heartbeat = pace_.heartbeat;
  const bool known = knows_round_trip();
  // The variation keeps a jittery path from being suspected every round.
  after_.suspect =
      (known ? std::max({kSuspectFloor, srtt * 3 / 2, srtt + 2 * rttvar}) : kSuspectUnknown) +
      pace_.feedback;
  after_.pulled =
      (known ? std::max(kPulledFloor, srtt + 4 * rttvar) : kPulledUnknown) * (1 << patience_) +
      pace_.feedback;
  after_.idle_suspect =
      std::max(times(heartbeat, kSuspectHeartbeats), heartbeat + srtt / 2 + 4 * rttvar);
  after_.idle_pulled = std::max({kIdlePulledFloor, heartbeat * kPulledHeartbeats, after_.pulled});
  after_.dead = std::max(kDeadSilence, times(heartbeat, kDeadHeartbeats));
  after_.proof = std::clamp<Duration>(4 * srtt, kLeastProof, kMostProof);
}

void PathMachine::set_patience(TimePoint now, int patience) {
  patience_ = patience;
  patience_at_ = now;
  set_thresholds();
}

// --- when silence becomes what; only while the path was heard once

TimePoint PathMachine::silent_since() const { return std::max(*heard_at_, quickened_at_); }

TimePoint PathMachine::suspect_at() const {
  const TimePoint idle = silent_since() + after_.idle_suspect;
  if (!waiting_.any()) return idle;
  // While acknowledgements come in, packets that are late wait in a queue and are no sign of
  // trouble.
  const TimePoint loaded =
      std::max(waiting_.since() + after_.suspect,
               acknowledged_at_ + std::max(kSuspectFloor, pace_.srtt / 2) + pace_.feedback);
  return std::min(idle, loaded);
}

TimePoint PathMachine::pulled_at() const {
  const TimePoint idle = silent_since() + after_.idle_pulled;
  if (!waiting_.any()) return idle;
  return std::min(idle, std::max(*heard_at_, waiting_.since()) + after_.pulled);
}

std::optional<TimePoint> PathMachine::latched_at() const {
  const Duration window = after_.proof;
  // The peer must have been heard through half a window at least.
  if (!unproven_enough_at_ || *heard_at_ - unproven_since_ < window / 2) return std::nullopt;
  // What has just left cannot have been acknowledged yet.
  return std::max(unproven_since_ + window, *unproven_enough_at_ + after_.suspect);
}

TimePoint PathMachine::dead_at() const { return silent_since() + after_.dead; }

// --- inputs

void PathMachine::set_pace(TimePoint now, const Pace& pace) {
  if (pace.heartbeat < pace_.heartbeat) quickened_at_ = now;
  if (pace != pace_) {
    pace_ = pace;
    set_thresholds();
  }
  if (pace_.queue > kQueueLong) long_queue_ = true;
  if (pace_.queue < kQueueShort) long_queue_ = false;
  reconsider(now);
}

void PathMachine::sent(TimePoint now, bool data) {
  if (!data) return;
  waiting_.sent(now);
  if (unproven_ == 0) unproven_since_ = now;
  unproven_ = std::min(unproven_ + 1, kUnproven);
  // Data must have been sent through half a window at least.
  if (!unproven_enough_at_ && unproven_ == kUnproven && now - unproven_since_ >= after_.proof / 2) {
    unproven_enough_at_ = now;
  }
}

void PathMachine::heard(TimePoint now) {
  const bool first = !heard_at_;
  const Duration silence = first ? Duration::zero() : now - *heard_at_;
  heard_at_ = now;
  if (state_ == PathState::kPulled) {
    take_back(now, silence);
  } else if (state_ == PathState::kDead) {
    if (first) {
      born_at_ = counted_to_ = now;
    } else {
      ramp_from_ = now;
    }
    forget_load();
    change(
        now, PathState::kOk,
        first ? "heard for the first time" : text("heard after %.0f ms of silence", silence, {}));
  }
  reconsider(now);
}

void PathMachine::take_back(TimePoint now, Duration silence) {
  set_patience(now, silence < kStall ? std::min(patience_ + 1, kMostPatience) : patience_);
  // Packets that were in flight are lost or about to be acknowledged, so they say nothing any more.
  forget_load();
  change(now, PathState::kOk, text("alive after %.0f ms of silence", silence, {}));
}

void PathMachine::all_proven() {
  unproven_ = 0;
  unproven_enough_at_.reset();
}

void PathMachine::forget_load() {
  waiting_ = {};
  all_proven();
  proof_since_.reset();
}

void PathMachine::delivered(TimePoint now, TimePoint sent_at, bool data) {
  acknowledged_at_ = now;
  waiting_.covered(sent_at);
  // The acknowledgement may have come over another path: this one was alive when the packet left.
  if (state_ != PathState::kDead && sent_at > *heard_at_) {
    const Duration silence = now - *heard_at_;
    heard_at_ = sent_at;
    if (state_ == PathState::kPulled && sent_at > changed_at_) take_back(now, silence);
  }
  if (data) {
    all_proven();
    if (state_ == PathState::kLatched) {
      if (!proof_since_ || now - proof_at_ > after_.proof) proof_since_ = now;
      proof_at_ = now;
      if (now - *proof_since_ >= 2 * after_.proof) {
        ramp_from_ = now;
        const Duration proven = now - *proof_since_;
        proof_since_.reset();
        change(now, PathState::kOk, text("data delivered for %.0f ms", proven, {}));
      }
    }
  }
  reconsider(now);
}

void PathMachine::removed(TimePoint now) {
  count_outage(now);
  if (state_ != PathState::kDead) change(now, PathState::kDead, "removed");
}

void PathMachine::handle_timeout(TimePoint now) {
  count_outage(now);
  if (patience_ > 0 && now - patience_at_ >= kForgiven) set_patience(now, patience_ - 1);
  reconsider(now);
}

// --- transitions

void PathMachine::reconsider(TimePoint now) {
  if (state_ == PathState::kDead) return;
  if (now >= dead_at()) {
    change(now, PathState::kDead,
           text("silent for %.0f ms (limit %.0f ms)", now - *heard_at_, after_.dead));
    return;
  }
  if (!usable()) {
    if (last_usable_) change(now, PathState::kSuspect, "the last path there is");
    return;
  }
  if (!last_usable_ && now >= pulled_at()) {
    change(now, PathState::kPulled, silence_text(now));
    return;
  }
  if (const auto latched = latched_at(); !last_usable_ && latched && now >= *latched) {
    proof_since_.reset();
    change(now, PathState::kLatched,
           text("no data delivered for %.0f ms, though the peer is heard (limit %.0f ms)",
                now - unproven_since_, after_.proof));
    return;
  }
  const bool late = now >= suspect_at();
  if (state_ == PathState::kOk && (late || long_queue_)) {
    change(now, PathState::kSuspect,
           late ? silence_text(now)
                : text("queue of %.0f ms (limit %.0f ms)", pace_.queue, kQueueLong));
  } else if (state_ == PathState::kSuspect && !late && !long_queue_) {
    change(now, PathState::kOk, "acknowledged again, no long queue");
  }
}

std::string PathMachine::silence_text(TimePoint now) const {
  if (waiting_.any()) {
    return text("nothing acknowledged for %.0f ms (round trip %.0f ms)", now - waiting_.since(),
                pace_.srtt);
  }
  return text("silent for %.0f ms (a heartbeat every %.0f ms)", now - *heard_at_, pace_.heartbeat);
}

void PathMachine::change(TimePoint now, PathState to, std::string reason) {
  count_outage(now);
  if (changes_count_ == changes_.size()) {
    changes_first_ = (changes_first_ + 1) % changes_.size();
    --changes_count_;
  }
  changes_[(changes_first_ + changes_count_++) % changes_.size()] = {state_, to, std::move(reason)};
  state_ = to;
  changed_at_ = now;
}

// --- outputs

double PathMachine::share(TimePoint now) const {
  if (!usable()) return 0;
  if (!ramp_from_ || now - *ramp_from_ >= kRamp) return 1;
  return kLeastShare + (1 - kLeastShare) * static_cast<double>((now - *ramp_from_).count()) /
                           static_cast<double>(kRamp.count());
}

std::optional<PathMachine::Change> PathMachine::poll_change() {
  if (changes_count_ == 0) return std::nullopt;
  Change out = std::move(changes_[changes_first_]);
  changes_first_ = (changes_first_ + 1) % changes_.size();
  --changes_count_;
  return out;
}

std::optional<TimePoint> PathMachine::next_timeout() const {
  if (state_ == PathState::kDead) return std::nullopt;
  TimePoint next = dead_at();
  if (patience_ > 0) next = std::min(next, patience_at_ + kForgiven);
  // A path that became the last one changes its state at once: that instant is past.
  if (!usable()) return last_usable_ ? *heard_at_ : next;
  if (state_ == PathState::kOk) next = std::min(next, suspect_at());
  return last_usable_ ? next : earliest(latched_at(), next, pulled_at());
}

// Adds the time since the last call to the seconds that it lies in, if the path was not usable.
void PathMachine::count_outage(TimePoint now) {
  if (!born_at_ || now <= counted_to_) return;
  TimePoint from = std::max(counted_to_, now - kOutageWindow);
  counted_to_ = now;
  if (usable()) return;
  if (outage_.empty()) outage_.resize(kOutageSeconds);
  while (from < now) {
    const std::int64_t second = second_of(from);
    const TimePoint end = std::min(now, TimePoint{seconds(second + 1)});
    const auto place = static_cast<std::uint64_t>(second) % outage_.size();
    OutageSecond& slot = outage_[place];
    if (slot.second != second) slot = {second, {}};
    slot.out += end - from;
    from = end;
  }
}

double PathMachine::outage(TimePoint now) const {
  if (!born_at_ || now <= *born_at_) return 0;
  const TimePoint from = std::max(*born_at_, now - kOutageWindow);
  Duration out{};
  for (const OutageSecond& slot : outage_) {
    if (slot.second >= second_of(from)) out += slot.out;
  }
  if (!usable()) out += now - std::max(counted_to_, from);
  return std::min(1.0,
                  static_cast<double>(out.count()) / static_cast<double>((now - from).count()));
}

}  // namespace interneuron::link
