#include "lab/foreign/subflow.h"

#include <algorithm>
#include <cassert>
#include <chrono>
#include <utility>

namespace interneuron::foreign {
namespace {

using namespace std::chrono_literals;

// RFC 6298, sections 2.1 to 2.3, but for the least timeout: 200 ms as in Linux
// (TCP_RTO_MIN), where the RFC says 1 s, which nobody uses.
constexpr Duration kFirstTimeout = 1s;
constexpr Duration kLeastTimeout = 200ms;
constexpr Duration kLongestTimeout = 120s;
// A segment is lost when one sent this many later has arrived (RFC 9002, section 6.1.1).
constexpr std::uint64_t kReordering = 3;
// Or one sent a quarter of the round trip later (RFC 8985, section 6.2).
constexpr int kReorderingTime = 4;
// RFC 8985, section 7.2: the probe waits two round trips, longer when the receiver may hold back
// the acknowledgement of a single segment.
constexpr int kProbeRoundTrips = 2;
constexpr Duration kHeldBack = 200ms;
constexpr int kMostBackoff = 6;

}  // namespace

bool SubflowSender::can_send(Duration now) const {
  return in_flight_ + kMss <= std::max<std::size_t>(control_->window(), kMss) &&
         now >= next_departure_;
}

Duration SubflowSender::retransmission_timeout() const {
  const Duration base =
      smoothed_ == Duration{} ? kFirstTimeout : std::max(kLeastTimeout, smoothed_ + 4 * variation_);
  return std::min(kLongestTimeout, base * (1 << backoff_));
}

void SubflowSender::stamp(Sent& sent, Duration now) {
  if (in_flight_ == 0) {
    if (order_ > 0) control_->restarted(now - last_sent_, retransmission_timeout());
    delivered_at_ = now;
    first_sent_at_ = now;
  }
  sent.order = order_++;
  sent.at = now;
  sent.delivered_before = delivered_;
  sent.delivered_at = delivered_at_;
  sent.first_sent_at = first_sent_at_;
  sent.application_limited = delivered_ < limited_until_;
  in_flight_ += sent.piece.bytes;
  peak_in_flight_ = std::max(peak_in_flight_, in_flight_);
  last_sent_ = now;
  if (const auto rate = control_->pacing_rate()) {
    next_departure_ =
        std::max(now, next_departure_) + rate->transmit_time(sent.piece.bytes + kTcpIpBytes);
  }
  if (!timer_) arm(now);
}

DataSegment SubflowSender::segment(const Sent& sent) {
  return DataSegment{.sequence = sent.sequence, .piece = sent.piece, .sent = sent.at};
}

DataSegment SubflowSender::send(Duration now, const Piece& piece) {
  Sent sent{.sequence = next_sequence_, .piece = piece};
  stamp(sent, now);
  sent_.push_back(sent);
  next_sequence_ += piece.bytes;
  DataSegment out = segment(sent);
  // New data alone carry the answer (RFC 3168, section 6.1.2).
  out.window_reduced = std::exchange(tell_reduced_, false);
  return out;
}

DataSegment SubflowSender::send_again(Duration now) {
  const auto it = std::ranges::find(sent_, true, &Sent::lost);
  assert(it != sent_.end());
  it->lost = false;
  it->again = true;
  lost_bytes_ -= it->piece.bytes;
  stamp(*it, now);
  return segment(*it);
}

void SubflowSender::leaves_flight(const Sent& sent) {
  if (sent.lost) {
    lost_bytes_ -= sent.piece.bytes;
  } else if (!sent.sacked) {
    in_flight_ -= sent.piece.bytes;
  }
}

// A segment is known to have arrived.
void SubflowSender::hear(Sent& sent, Heard& heard) {
  if (sent.sacked) return;
  leaves_flight(sent);
  sent.lost = false;
  sent.sacked = true;
  heard.bytes += sent.piece.bytes;
  newest_heard_order_ = std::max(newest_heard_order_, sent.order);
  newest_heard_at_ = std::max(newest_heard_at_, sent.at);
  if (heard.bytes == sent.piece.bytes || sent.order > heard.newest.order) heard.newest = sent;
}

SubflowSender::Heard SubflowSender::hear_all(const AckSegment& ack) {
  Heard heard;
  while (!sent_.empty() && sent_.front().sequence < ack.acknowledged) {
    hear(sent_.front(), heard);
    sent_.pop_front();
  }
  for (std::size_t i = 0; i < ack.sack_count; ++i) {
    auto it = std::ranges::lower_bound(sent_, ack.sacks[i].from, {}, &Sent::sequence);
    for (; it != sent_.end() && it->sequence < ack.sacks[i].to; ++it) hear(*it, heard);
  }
  return heard;
}

void SubflowSender::find_losses(Duration now) {
  bool found = false;
  for (Sent& sent : sent_) {
    if (sent.sacked || sent.lost || sent.order > newest_heard_order_) continue;
    const bool overtaken = sent.order + kReordering <= newest_heard_order_;
    if (!overtaken && sent.at + smoothed_ / kReorderingTime > newest_heard_at_) continue;
    in_flight_ -= sent.piece.bytes;
    lost_bytes_ += sent.piece.bytes;
    sent.lost = true;
    found = found || sent.sequence >= reduced_until_;
  }
  if (found) reduce(now);
}

void SubflowSender::reduce(Duration now) {
  control_->congested(now);
  reduced_until_ = next_sequence_;
}

void SubflowSender::measure_rtt(Duration rtt) {
  if (smoothed_ == Duration{}) {
    smoothed_ = rtt;
    variation_ = rtt / 2;
    return;
  }
  const Duration error = rtt > smoothed_ ? rtt - smoothed_ : smoothed_ - rtt;
  variation_ = (3 * variation_ + error) / 4;
  smoothed_ = (7 * smoothed_ + rtt) / 8;
}

Delivery SubflowSender::delivery(Duration now, const Heard& heard, Duration rtt) {
  const Sent& newest = heard.newest;
  Delivery d{
      .now = now, .bytes = heard.bytes, .round_began = newest.delivered_before >= round_ends_};
  if (d.round_began) {
    round_ends_ = delivered_;
    last_peak_in_flight_ = peak_in_flight_;
    peak_in_flight_ = in_flight_;
  }
  d.peak_in_flight = std::max(last_peak_in_flight_, peak_in_flight_);
  d.smoothed_rtt = smoothed_;
  if (!newest.again) d.rtt = rtt;
  const Duration took = std::max(now - newest.delivered_at, newest.at - newest.first_sent_at);
  d.rate = rate_of(delivered_ - newest.delivered_before, took);
  d.application_limited = newest.application_limited;
  d.in_flight = in_flight_;
  return d;
}

void SubflowSender::acknowledged(Duration now, const AckSegment& ack) {
  const Heard heard = hear_all(ack);
  if (heard.bytes > 0) {
    delivered_ += heard.bytes;
    delivered_at_ = now;
    first_sent_at_ = heard.newest.at;
    backoff_ = 0;
    probed_ = false;
    measure_rtt(now - ack.echo);
  }
  if (!sent_.empty() && newest_heard_order_ > sent_.front().order) find_losses(now);
  // Acknowledgements of what was sent before the answer still repeat the mark.
  if (ack.congestion_seen && ack.acknowledged > reduced_until_) {
    reduce(now);
    tell_reduced_ = true;
  }
  if (heard.bytes > 0) {
    control_->delivered(delivery(now, heard, now - ack.echo));
    arm(now);
  }
}

// The timer restarts with everything that is heard (RFC 6298, section 5.3).
void SubflowSender::arm(Duration now) {
  timer_.reset();
  if (in_flight_ == 0 && lost_bytes_ == 0) return;
  const Duration timeout = retransmission_timeout();
  timer_ = now + timeout;
  timer_is_probe_ = false;
  if (probed_ || backoff_ > 0 || smoothed_ == Duration{} || lost_bytes_ > 0) return;
  const Duration wait =
      kProbeRoundTrips * smoothed_ + (in_flight_ <= kMss ? kHeldBack : Duration{});
  if (wait >= timeout) return;
  timer_ = now + wait;
  timer_is_probe_ = true;
}

std::vector<Piece> SubflowSender::handle_timeout(Duration now) {
  std::vector<Piece> out;
  if (!timer_ || now < *timer_) return out;
  if (timer_is_probe_) {
    // The last segment counts as lost and leaves again, whatever the window says.
    const auto last = std::find_if(sent_.rbegin(), sent_.rend(),
                                   [](const Sent& s) { return !s.sacked && !s.lost; });
    if (last != sent_.rend()) {
      in_flight_ -= last->piece.bytes;
      lost_bytes_ += last->piece.bytes;
      last->lost = true;
    }
    probed_ = true;
    arm(now);
    return out;
  }
  for (Sent& sent : sent_) {
    if (sent.sacked) continue;
    out.push_back(sent.piece);
    if (sent.lost) continue;
    in_flight_ -= sent.piece.bytes;
    lost_bytes_ += sent.piece.bytes;
    sent.lost = true;
  }
  control_->timed_out(now);
  reduced_until_ = next_sequence_;
  ++timeouts_;
  backoff_ = std::min(backoff_ + 1, kMostBackoff);
  next_departure_ = now;
  arm(now);
  return out;
}

std::optional<Duration> SubflowSender::next_timeout(bool wants_to_send) const {
  std::optional<Duration> out = timer_;
  const bool waits_for_pace = (wants_to_send || has_lost()) &&
                              in_flight_ + kMss <= std::max<std::size_t>(control_->window(), kMss);
  if (waits_for_pace && (!out || next_departure_ < *out)) out = next_departure_;
  return out;
}

}  // namespace interneuron::foreign
