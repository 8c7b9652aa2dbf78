#include "core/peers/path.h"

#include <algorithm>
#include <cmath>

#include "core/base/earliest.h"
#include "core/base/slow_link.h"

namespace interneuron::peers {
namespace {

// Challenges of a peer whose address has changed are this far apart: as far as the packets of its
// heartbeat at least (link::ProbeSchedule::kActiveHeartbeat), less what jitter may bring.
constexpr Duration kBetweenChallenges = std::chrono::milliseconds(20);
// A train may catch up with this much time at its rate after a late timer (docs/constants.md, "Rate
// of a link").
constexpr Duration kBurst = std::chrono::milliseconds(1);
// The longest time between two packets of a train: at the lowest rates a train would last for
// minutes, and other probes wait for its end.
constexpr Duration kLongest = std::chrono::seconds(1);
// Copies of feedback take at most this share of what messages bring in over the path beyond
// kIdleRate: a feedback about two paths for every four packets, where one is due every 16 or 5 ms
// (src/core/peers/feedback_due.h). A path that answers alone come over counts as idle: no
// measurement behind that rate, which is that of ten answers of 3 KB a second and some.
constexpr double kCopyShare = 0.05;
constexpr DataRate kIdleRate{300'000};
// What may be saved up for copies, in bytes. No measurement behind this value: it is a dozen copies
// of feedback about two paths, which are the reports on a burst of 200 packets.
constexpr double kMostCopyCredit = 4096;
// The loss of a report is in 1/65535 (docs/wire_format.md).
constexpr double kLossUnit = 65535;
// While little has been seen of a path it is supposed to lose one packet in a
// hundred, with the weight of that many. No measurement behind these values.
constexpr double kSupposedLoss = 0.01;
constexpr double kSupposedPackets = 100;

// Whether a report tells that this packet has arrived, whose number is not above its largest.
bool has_arrived(const wire::LinkReport& report, std::uint64_t number) {
  const std::uint64_t back = report.largest - number;
  if (back == 0) return true;
  return back <= wire::kAckWindow &&
         (report.bitmap[(back - 1) / 64] >> ((back - 1) % 64) & 1U) != 0;
}

}  // namespace

Path::Path(TimePoint now, LinkId id, const Nic& nic, const Address& address, const Origin& origin)
    : receiver(id),
      id_(id),
      seed_(origin.seed),
      share_(origin.seed),
      mtu_(nic.max_datagram),
      nic_(nic),
      address_(address),
      may_measure_(origin.connected) {
  begin(now);
}

void Path::begin(TimePoint now) {
  estimator.set_traits(nic_.traits);
  probes.set_metered(is_paid());
  probes.set_sizes(wire::feedback_bytes(1) + kIpUdpBytes, datagram() + kIpUdpBytes);
  probes.active(now);
}

void Path::move_to(TimePoint now, const Nic& nic, const Address& address) {
  // Another address of the same NIC is nearly always the same way.
  if (nic.link != nic_.link || nic.max_datagram != nic_.max_datagram) {
    mtu_ = link::PathMtu(nic.max_datagram);
  }
  ecn_.moved();
  nic_ = nic;
  address_ = address;
  probes = {};
  train_ = {};
  begin(now);
}

void Path::reset(TimePoint now) {
  Path fresh(now, id_, nic_, address_, {may_measure_, seed_});
  // A session does not change whether the peer pays for bytes, which token it is owed, when it may
  // be challenged again, what copies may take and whether messages go over the path.
  fresh.peer_is_metered_ = peer_is_metered_;
  fresh.token_ = token_;
  fresh.challenge_at_ = challenge_at_;
  fresh.copy_credit_ = copy_credit_;
  fresh.credited_at_ = credited_at_;
  fresh.used_ = used_;
  *this = fresh;
  probes.set_metered(is_paid());
}

bool Path::may_challenge(TimePoint now) {
  if (now < challenge_at_) return false;
  challenge_at_ = now + kBetweenChallenges;
  return true;
}

DataRate Path::slow_rate() const {
  const DataRate rate = estimator.rate().value_or(DataRate{});
  return !is_paid() && is_slow(rate) ? rate : DataRate{};
}

DataRate Path::peer_slow_rate() const {
  return !is_paid() && is_slow(estimator.rate_down()) ? estimator.rate_down() : DataRate{};
}

bool Path::usable() const {
  return estimator.path() == PathState::kOk || estimator.path() == PathState::kSuspect;
}

void Path::sent_feedback(TimePoint now) {
  estimator.sent(now, false);
  probes.heartbeat_sent(now);
}

void Path::sent_data(TimePoint now, std::size_t ip_bytes) {
  used_ = true;
  share_.sent(now, ip_bytes);
  ecn_.sent(now);
  estimator.sent(now, true);
  probes.data_sent(now);
}

void Path::sent_probe(TimePoint now, std::uint64_t number) {
  train_.newest = number;
  share_.sent(now, datagram() + kIpUdpBytes);
  ecn_.sent(now);
  estimator.sent(now, true);
}

void Path::sent_mtu_probe(TimePoint now, std::uint64_t number) {
  ecn_.sent(now);
  estimator.sent(now, false);
  mtu_.probe_sent(now, number);
}

void Path::learn(TimePoint now, const wire::LinkReport& report,
                 const flow::SentPackets::Verdicts& v, const flow::PathUse::Told& use) {
  for (const auto& [arrived, packets] : v.runs) {
    if (arrived) {
      estimator.arrived(now, packets);
    } else {
      estimator.lost(now, packets);
    }
  }
  if (v.newest_sent) estimator.delivered(now, *v.newest_sent, v.data);
  if (v.delivery) estimator.delivery_sample(now, *v.delivery);
  if (train_.left == 0 && report.largest >= train_.newest) probes.train_told();
  if (v.train) estimator.train(now, *v.train);
  estimator.passed(now, v.passed);
  control(now, report, v, use);
  const auto probe = mtu_.waits_for();
  if (probe && report.largest >= *probe) mtu_.probe_told(has_arrived(report, *probe));
  mtu_.packets_told(v.sizes);
  estimator.peer_sees(report.rate, report.loss / kLossUnit);
  peer_is_metered_ = report.metered;
  may_measure_ = true;
}

void Path::control(TimePoint now, const wire::LinkReport& report,
                   const flow::SentPackets::Verdicts& v, const flow::PathUse::Told& use) {
  cc::ShareControl::Report told;
  if (v.newest_sent && v.data) told.round_trip = now - *v.newest_sent;
  if (v.data && report.has_delays) told.one_way_us = report.newest_delay_us;
  for (const auto& [piece, arrived, was_open] : v.pieces) {
    if (!arrived && was_open) ++told.lost;
    if (arrived) told.arrived += datagram() + kIpUdpBytes;
  }
  told.lost += use.lost;
  if (v.train) {
    const Duration least = estimator.rtt_min(now);
    const bool is_known = told.round_trip && least > Duration::zero();
    told.train = {v.train->packets, v.train->measured, v.train->sent_at,
                  is_known ? *told.round_trip - least : Duration{}};
  }
  told.capacity = estimator.rate_guess();
  told.held_back = use.held_back;
  told.backlog = use.backlog;
  told.needed = use.needed;
  const bool was_mangled = ecn_.state() == EcnState::kMangled;
  const auto marks = ecn_.report(now, {report.largest, report.ect0_packets, report.ect1_packets,
                                       report.ce_packets, v.ect_arrived, v.newest_sent});
  if (!was_mangled && ecn_.state() == EcnState::kMangled) share_.marks_were_false();
  told.ect = marks.arrived;
  told.marked = marks.marked;
  share_.report(now, told);
}

void Path::clock_stepped() {
  estimator.clock_stepped();
  share_.clock_stepped();
}

void Path::learn_exchange(TimePoint now, PeerTime u, const wire::LinkReport& report) {
  const std::int64_t r = now.time_since_epoch().count();
  const std::int64_t s = report.s.time_since_epoch().count();
  const std::int64_t h = report.h.count();
  const std::int64_t u_ns = u.time_since_epoch().count();
  estimator.round_trip(now, Duration{wrapping_sub(wrapping_sub(r, s), h)});
  share_.exchange(now, TimePoint{report.s.time_since_epoch()},
                  Duration{wrapping_sub(wrapping_sub(u_ns, h), s)});
  estimator.one_way_delays(now, Duration{wrapping_sub(wrapping_sub(u_ns, h), s)},
                           Duration{wrapping_sub(r, u_ns)});
}

void Path::refresh(TimePoint now, bool ready, DataRate needed, Duration peer_spacing) {
  estimator.set_feedback_spacing(now, peer_spacing);
  probes.set_needed(needed);
  probes.set_slower(estimator.slower_rate());
  probes.set_metered(is_paid());
  probes.set_rate(estimator.rate_evidence());
  probes.set_latched(estimator.path() == PathState::kLatched);
  const bool may_measure = ready && may_measure_ && usable();
  mtu_.set_ready(now, may_measure);
  probes.set_ready(may_measure && !mtu_.answer_is_near(now));
  probes.set_sizes(wire::feedback_bytes(1) + kIpUdpBytes, datagram() + kIpUdpBytes);
  estimator.set_heartbeat(now, probes.heartbeat_interval(now));
}

bool Path::may_copy(std::size_t ip_bytes) const {
  return slow_rate() == DataRate{} && copy_credit_ >= static_cast<double>(ip_bytes) && !is_paid() &&
         nic_.traits.role == LinkRole::kNormal;
}

void Path::received_message(TimePoint now, std::size_t ip_bytes) {
  const double seconds = to_ms(now - credited_at_.value_or(now)) / 1e3;
  const double idle = seconds * static_cast<double>(kIdleRate.bits_per_second) / 8;
  credited_at_ = now;
  copy_credit_ = std::max(copy_credit_ - kCopyShare * idle, 0.0);
  copy_credit_ += kCopyShare * static_cast<double>(ip_bytes);
  copy_credit_ = std::min(copy_credit_, kMostCopyCredit);
}

bool Path::probe_due(TimePoint now) {
  if (train_.left == 0) {
    const auto train = probes.train_due(now);
    if (!train) {
      if (!probes.proof_due(now)) return false;
      probes.proof_sent(now);
      return true;
    }
    probes.train_sent(now, train->packets);
    train_.left = train->packets;
    train_.pace = capped(train->pace);
    train_.next = now;
  }
  if (train_.next > now) return false;
  --train_.left;
  if (train_.pace) {
    const Duration air = train_.pace->transmit_time(datagram() + kIpUdpBytes);
    train_.next = std::max(train_.next, now - kBurst) + std::min<Duration>(air, kLongest);
  }
  return true;
}

std::optional<std::size_t> Path::mtu_probe_due() const {
  // Where bytes are paid for, nobody searches for messages that may never come.
  const bool worthwhile = used_ || !is_paid();
  if (!worthwhile || !may_measure_ || !mtu_.probe_due()) return std::nullopt;
  return mtu_.probe_size();
}

TimePoint Path::next_timeout(TimePoint now) const {
  // Other probes wait for the end of a train, however slow it is and however long they are due.
  const TimePoint next =
      train_.left > 0 ? std::min(probes.heartbeat_at(now), train_.next) : probes.next_timeout(now);
  return *earliest(estimator.next_timeout(), mtu_.next_timeout(), next);
}

wire::LinkReport Path::report(TimePoint now) const {
  wire::LinkReport report = receiver.report(now);
  report.metered = nic_.traits.metered;
  report.rate = estimator.rate().value_or(DataRate{});
  report.loss =
      static_cast<std::uint16_t>(std::lround(std::clamp(estimator.loss(), 0.0, 1.0) * kLossUnit));
  return report;
}

// At most what the operator allows. Estimates keep to that themselves once there are any.
std::optional<DataRate> Path::capped(std::optional<DataRate> rate) const {
  const std::optional<DataRate> cap = estimator.cap();
  return rate && cap ? std::min(*rate, *cap) : rate ? rate : cap;
}

// What may be lost: what was, or what was lately if that is more, and a little even where nothing
// was: a radio that has lost nothing in a good hour loses one packet in a hundred in the next bad
// second, and by the time that this is known, messages are lost.
code::Losses Path::losses() const {
  const double seen = estimator.quick_loss_packets();
  const double lately = (estimator.quick_loss() * seen + kSupposedLoss * kSupposedPackets) /
                        (seen + kSupposedPackets);
  return {std::max(estimator.loss(), lately), estimator.loss_burst(),
          estimator.loss_burst_deviation()};
}

// While the peer holds back its feedback, what has arrived counts as in flight.
std::size_t Path::window() const {
  const std::size_t window = share_.window();
  if (window == SIZE_MAX || estimator.feedback_spacing() == Duration::zero()) return window;
  const double bits = to_seconds(estimator.feedback_spacing()) *
                      static_cast<double>(share_.rate().value_or(DataRate{}).bits_per_second);
  return window + static_cast<std::size_t>(bits / 8);
}

flow::PathView Path::view(TimePoint now) const {
  // What may be planned with is our share of the pipe.
  const std::optional<DataRate> own = share_.pace();
  const std::optional<DataRate> pace = own ? own : estimator.pace();
  // A path that came back is loaded little by little.
  const double share = estimator.share(now);
  const auto shared = [share](std::optional<DataRate> rate) {
    return rate ? std::optional(rate->scaled(share)) : std::nullopt;
  };
  flow::PathView view;
  view.up = estimator.up();
  view.suspect = estimator.path() == PathState::kSuspect;
  view.backup = nic_.traits.role == LinkRole::kBackup;
  // The arrival of a piece is a guess anyhow: with a guess of the rate it is a better one.
  view.rate = shared(share_.planned() ? share_.planned() : estimator.rate_guess());
  view.pace = shared(capped(pace.value_or(flow::kBlindPace)));
  view.soon = shared(share_.soon(now));
  view.best = estimator.best_rate();
  view.best_at = estimator.guessed_at();
  view.report_spacing = estimator.feedback_spacing();
  view.window = window();
  view.loaded = share_.loaded(now);
  view.crowded = share_.is_crowded();
  view.short_queue = share_.marked(now);
  view.slow = slow_rate() > DataRate{};
  view.one_way = estimator.one_way();
  view.least_one_way = share_.least_one_way(estimator.rtt_min(now));
  view.ect = ecn_.bits() != link::kNotEct;
  view.probe_timeout = estimator.probe_timeout(now);
  view.jitter = estimator.jitter();
  view.losses = losses();
  return view;
}

LinkState Path::state(TimePoint now) const {
  LinkState state = estimator.state(now);
  state.id = id_;
  state.ecn = ecn_.state();
  // Trains among those of others show less than the pipe.
  state.rate = std::max(state.rate, share_.known_capacity());
  // A path that came back is loaded little by little.
  state.share =
      std::min(state.rate, share_.planned().value_or(state.rate)).scaled(estimator.share(now));
  return state;
}

}  // namespace interneuron::peers
