#include "core/flow/sent_packets.h"

#include <algorithm>
#include <cassert>

namespace interneuron::flow {
namespace {

// The reordering window is a quarter of the smallest round trip (RFC 8985 §6.2), but not less than
// this: what arrives late is reported up to 5 ms later (src/core/peers/feedback_due.h).
constexpr int kWindowDivisor = 4;
constexpr Duration kLeastWindow = std::chrono::milliseconds(6);
// However late packets come, more than this or a round trip is not waited for. No measurement
// behind this value: it only has to leave most deadlines time for a second copy.
constexpr Duration kMostWindow = std::chrono::milliseconds(30);
// So many losses without reordering end what was learnt of it: 16 recoveries in RFC 8985 §6.2.
constexpr std::uint64_t kForgetReordering = 16;
// What a report does not tell of so long after it left is lost: the longest routine stall of a
// radio is 800 ms (docs/constants.md, "States of a path").
constexpr Duration kUntold = std::chrono::seconds(1);
// A packet taken for lost may still arrive. As losses are counted, its loss is certain when this
// many later ones were sent, or after twice the timeout. Half the packets that an acknowledgement
// tells of (wire::kAckWindow).
constexpr std::uint64_t kLatePackets = 128;
// How long the records of packets are kept for late acknowledgements. No measurement behind this
// value: it only has to be larger than a round trip with full queues.
constexpr Duration kKeep = std::chrono::seconds(3);
// The same for those behind the last one that a report has told of: the first train of a path whose
// rate is not known, and that of the peer, in front of its reports, take 3 s each at 0.1 Mbit/s.
constexpr Duration kKeepUntold = std::chrono::seconds(8);
// Records per path: 3 s at 75 Mbit/s.
constexpr std::size_t kMaxKept = 20'000;
// Records of settled packets that are kept, because the beginning of a train is found in them: the
// packets of a raw frame and some more.
constexpr std::size_t kKeepSettled = 512;
// So many lookups of fragments in flight look at all of them before they are ordered for the next
// ones. No measurement behind this value: ordering n of them takes about log n looks at each.
constexpr std::uint32_t kLookupsToIndex = 8;

}  // namespace

void SentPackets::trim(TimePoint now) {
  while (log_.keeps(first_open_) && log_.at(first_open_).fate != Fate::kOpen) ++first_open_;
  const auto may_go = [this, now] {
    const std::uint64_t oldest = log_.oldest();
    const Duration kept = oldest <= largest_ ? kKeep : kKeepUntold;
    return log_.size() >= kMaxKept || log_.at(oldest).at < now - kept ||
           (log_.size() > kKeepSettled && oldest < std::min(first_open_, first_uncertain_));
  };
  while (log_.size() > 0 && may_go()) {
    const Packet& front = log_.at(log_.oldest());
    if (front.fate == Fate::kOpen && front.data_sized) close(front);
    newest_dropped_ = front.at;
    log_.drop();
  }
  first_open_ = std::max(first_open_, log_.oldest());
  first_uncertain_ = std::max(first_uncertain_, log_.oldest());
}

SentPackets::Packet& SentPackets::record(TimePoint now) {
  trim(now);
  return log_.add(now);
}

std::uint64_t SentPackets::add_small(TimePoint now) {
  record(now);
  return log_.next() - 1;
}

std::uint64_t SentPackets::add(TimePoint now, std::size_t ip_bytes, bool more_waits,
                               const std::optional<Piece>& piece) {
  Packet& packet = record(now);
  packet.ect = ect_;
  packet.has_piece = piece.has_value();
  assert(ip_bytes <= UINT16_MAX);
  const auto bytes = static_cast<std::uint16_t>(ip_bytes);
  train_bytes_ += bytes;
  const link::DeliveryStamp stamp = delivery_.sent(now, bytes, open_data_ == 0, more_waits);
  packet.app_limited = stamp.app_limited;
  const Piece carried = piece.value_or(Piece{});
  log_.add_data(
      packet, {stamp.first_sent_at, stamp.delivered_at, static_cast<std::uint32_t>(stamp.delivered),
               train_bytes_, carried.message, carried.index, bytes});
  ++open_data_;
  lookups_ = 0;
  if (packet.has_piece) open_bytes_ += ip_bytes;
  return log_.next() - 1;
}

std::uint64_t SentPackets::add_mtu_probe(TimePoint now, std::size_t ip_bytes) {
  const std::uint64_t number = add(now, ip_bytes, false, std::nullopt);
  log_.at(number).mtu_probe = true;
  return number;
}

// Whether not every path carries it.
bool SentPackets::is_large(const Packet& packet) const {
  return packet.data_sized && log_.data_of(packet).bytes > link::PathMtu::kBase + kIpUdpBytes;
}

link::DeliveryStamp SentPackets::stamp_of(const Packet& packet) const {
  const PacketLog::Data& data = log_.data_of(packet);
  const std::uint64_t since = static_cast<std::uint32_t>(delivery_.delivered()) - data.delivered;
  return {packet.at,  data.first_sent_at, data.delivered_at, delivery_.delivered() - since,
          data.bytes, packet.app_limited};
}

void SentPackets::close(const Packet& packet) {
  --open_data_;
  lookups_ = 0;
  if (packet.has_piece) open_bytes_ -= log_.data_of(packet).bytes;
}

void SentPackets::lose(Packet& packet) {
  packet.fate = Fate::kLost;
  if (packet.mtu_probe) return close(packet);
  ++lost_;
  if (is_large(packet)) sizes_.lost(packet.at);
  if (++lost_since_ > kForgetReordering) {
    reordering_ = false;
    lateness_ = {};
  }
  if (packet.data_sized) close(packet);
  if (packet.has_piece) settled_.push_back({piece_of(packet), false, true});
}

// A packet that an earlier report has missed was overtaken.
void SentPackets::note_reordering(TimePoint now, const Packet& packet) {
  reordering_ = true;
  lost_since_ = 0;
  const Duration late = now - packet.at - newest_rtt_;
  lateness_ = std::max<Duration>(lateness_, late + late / kWindowDivisor);
}

void SentPackets::arrive(TimePoint now, std::uint64_t number, Verdicts& verdicts) {
  Packet& packet = log_.at(number);
  // What comes long after its loss was certain tells of its message, and of nothing else.
  const bool is_straggler = number < first_uncertain_;
  if (packet.covered && number < largest_ && !is_straggler) note_reordering(now, packet);
  if (packet.at > newest_at_) {
    newest_at_ = packet.at;
    newest_rtt_ = now - packet.at;
  }
  const bool was_open = packet.fate == Fate::kOpen;
  packet.fate = Fate::kArrived;
  if (packet.ect) ++verdicts.ect_arrived;
  if (!packet.mtu_probe) sizes_.arrived(packet.at, is_large(packet));
  if (packet.has_piece) {
    progress_at_ = now;
    settled_.push_back({piece_of(packet), true, was_open});
  }
  if (is_straggler) return;
  verdicts.data = verdicts.data || packet.data_sized;
  verdicts.newest_sent = std::max(verdicts.newest_sent.value_or(packet.at), packet.at);
  if (!was_open) return;
  if (!packet.data_sized) return;
  close(packet);
  delivery_.acknowledged(now, stamp_of(packet));
}

SentPackets::Verdicts SentPackets::report(TimePoint now, const wire::LinkReport& report,
                                          Duration min_rtt, const Silence& silence) {
  Verdicts verdicts;
  settled_.clear();
  runs_.clear();
  if (report.largest == 0 || report.largest >= log_.next()) return verdicts;
  const auto arrived = [&report](std::uint64_t back) {
    return back == 0 || (report.bitmap[(back - 1) / 64] >> ((back - 1) % 64) & 1U) != 0;
  };
  min_rtt_ = min_rtt;
  for (std::uint64_t n = first_of_interest(report.largest); n <= report.largest && log_.keeps(n);
       ++n) {
    Packet& packet = log_.at(n);
    const std::uint64_t back = report.largest - n;
    if (packet.fate == Fate::kArrived || back > wire::kAckWindow) continue;
    if (arrived(back)) {
      arrive(now, n, verdicts);
    } else {
      packet.covered = true;
    }
  }
  largest_ = std::max(largest_, report.largest);
  lose_overdue(now, report);
  if (report.largest == largest_) lose_untold(now, report.largest, silence.timeout);
  verdicts.train = train_.told(log_, report);
  verdicts.delivery = delivery_.sample(min_rtt);
  verdicts.sizes = std::exchange(sizes_, {});
  tell_certain(now, report.largest, silence.timeout);
  verdicts.passed = passed_.told(log_);
  trim(now);
  verdicts.pieces = settled_;
  verdicts.runs = runs_;
  return verdicts;
}

// The first packet of which a report with this largest number may tell something new.
std::uint64_t SentPackets::first_of_interest(std::uint64_t largest) {
  const std::uint64_t told_from = largest - std::min<std::uint64_t>(largest, wire::kAckWindow);
  first_missed_ = std::max({first_missed_, told_from, log_.oldest()});
  while (first_missed_ < first_uncertain_ && log_.at(first_missed_).fate == Fate::kArrived) {
    ++first_missed_;
  }
  return std::min(first_missed_, first_uncertain_);
}

void SentPackets::lose_overdue(TimePoint now, const wire::LinkReport& report) {
  const std::uint64_t reorder = reordering_ ? wire::kAckWindow + 1 : kReorderPackets;
  for (std::uint64_t n = first_uncertain_; n < report.largest && log_.keeps(n); ++n) {
    Packet& packet = log_.at(n);
    if (packet.fate != Fate::kOpen) continue;
    if (report.largest - n >= reorder || overdue_at(packet) <= now) lose(packet);
  }
}

// The peer still speaks of the path, and has not heard of what left long ago.
void SentPackets::lose_untold(TimePoint now, std::uint64_t largest, Duration timeout) {
  const TimePoint before = now - std::max<Duration>(kUntold, 2 * timeout);
  for (std::uint64_t n = std::max(largest + 1, first_uncertain_); log_.keeps(n); ++n) {
    Packet& packet = log_.at(n);
    if (packet.at > before) return;
    packet.covered = true;
    if (packet.fate == Fate::kOpen) lose(packet);
  }
}

// Whether the outcome of a settled packet will not change any more.
bool SentPackets::is_certain(TimePoint now, std::uint64_t n, std::uint64_t largest,
                             Duration timeout) const {
  const Packet& packet = log_.at(n);
  if (packet.fate == Fate::kArrived) return true;
  if (n > largest) return packet.covered;
  return largest - n >= kLatePackets || now - packet.at >= 2 * timeout;
}

void SentPackets::tell_certain(TimePoint now, std::uint64_t largest, Duration timeout) {
  for (; log_.keeps(first_uncertain_); ++first_uncertain_) {
    const Packet& packet = log_.at(first_uncertain_);
    if (packet.fate == Fate::kOpen || !is_certain(now, first_uncertain_, largest, timeout)) return;
    const bool arrived = packet.fate == Fate::kArrived;
    if ((!arrived && !packet.covered) || packet.mtu_probe) continue;
    if (runs_.empty() || runs_.back().arrived != arrived) runs_.push_back({arrived, 0});
    ++runs_.back().packets;
  }
}

TimePoint SentPackets::silent_at(const Packet& oldest, const Silence& silence) const {
  return std::max(oldest.at + silence.timeout, saturating_add(progress_at_, silence.between));
}

TimePoint SentPackets::overdue_at(const Packet& packet) const {
  const Duration least = std::max<Duration>(min_rtt_ / kWindowDivisor, kLeastWindow);
  const Duration most = std::max<Duration>(least, std::min<Duration>(kMostWindow, newest_rtt_));
  return packet.at + newest_rtt_ + std::clamp<Duration>(lateness_, least, most);
}

TimePoint SentPackets::lost_at(std::uint64_t number, const Silence& silence) const {
  const Packet& packet = log_.at(number);
  const TimePoint silent = silent_at(packet, silence);
  return number < largest_ ? std::min(silent, overdue_at(packet)) : silent;
}

std::span<const SentPackets::Settled> SentPackets::settle_silent(TimePoint now,
                                                                 const Silence& silence) {
  settled_.clear();
  if (open_bytes_ == 0) return settled_;
  for (std::uint64_t n = first_open_; log_.keeps(n); ++n) {
    Packet& packet = log_.at(n);
    if (lost_at(n, silence) > now) break;
    if (packet.is_open_piece()) lose(packet);
  }
  return settled_;
}

std::optional<TimePoint> SentPackets::silent_at(const Silence& silence) const {
  if (open_bytes_ == 0) return std::nullopt;
  for (std::uint64_t n = first_open_; log_.keeps(n); ++n) {
    const Packet& packet = log_.at(n);
    if (packet.is_open_piece()) return lost_at(n, silence);
  }
  return std::nullopt;
}

std::optional<TimePoint> SentPackets::awaited_since(MessageId message) const {
  if (open_bytes_ == 0) return std::nullopt;
  for (std::uint64_t n = std::max(log_.oldest(), largest_ + 1); log_.keeps(n); ++n) {
    const Packet& packet = log_.at(n);
    const bool counts =
        packet.has_piece && (packet.fate == Fate::kOpen || log_.data_of(packet).message == message);
    if (counts) return packet.at;
  }
  return std::nullopt;
}

// All fragments in flight, ordered; of the same fragment the newest copy last.
void SentPackets::index_copies() const {
  copies_.clear();
  for (std::uint64_t n = first_open_; log_.keeps(n); ++n) {
    const Packet& packet = log_.at(n);
    if (packet.is_open_piece()) copies_.emplace_back(piece_of(packet), packet.at);
  }
  std::ranges::stable_sort(copies_, {}, &std::pair<Piece, TimePoint>::first);
}

std::optional<TimePoint> SentPackets::sent_at(const Piece& piece) const {
  if (lookups_ < kLookupsToIndex) {
    ++lookups_;
    for (std::uint64_t n = log_.next(); n-- > first_open_ && log_.keeps(n);) {
      const Packet& packet = log_.at(n);
      if (packet.is_open_piece() && piece_of(packet) == piece) {
        return packet.at;
      }
    }
    return std::nullopt;
  }
  if (lookups_ == kLookupsToIndex) {
    ++lookups_;
    index_copies();
  }
  const auto behind =
      std::ranges::upper_bound(copies_, piece, {}, &std::pair<Piece, TimePoint>::first);
  if (behind == copies_.begin() || std::prev(behind)->first != piece) return std::nullopt;
  return std::prev(behind)->second;
}

std::optional<std::uint64_t> SentPackets::first_copy(const Piece& piece, TimePoint since) const {
  std::optional<std::uint64_t> out;
  for (std::uint64_t n = log_.next() - 1; log_.keeps(n) && log_.at(n).at >= since; --n) {
    const Packet& packet = log_.at(n);
    if (packet.has_piece && piece_of(packet) == piece) out = n;
  }
  return out;
}

void SentPackets::reset() {
  const std::uint64_t lost = lost_;
  *this = SentPackets(log_.next());
  lost_ = lost;
}

}  // namespace interneuron::flow
