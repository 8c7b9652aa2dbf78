#include "core/probe/measurement.h"

#include <algorithm>
#include <cassert>

namespace interneuron::probe {
namespace {

// Pings that are overdue by no more than this are sent at once; a sender that was kept from its
// work for longer goes on from now, so that it does not measure a burst of its own. No measurement
// behind this value: it only has to be larger than the usual delay of a timer.
constexpr Duration kCatchUp = std::chrono::milliseconds(50);
// Replies before the first train: the path answers, and the addresses that had to be looked up
// (ARP, routes) are known, so that the train does not wait for them.
constexpr std::size_t kPingsBeforeTrains = 3;
// Trains that told a rate; the median of five stays when two of them are off.
constexpr std::size_t kTrainsWanted = 5;
// Trains sent, those that were too short to tell a rate included.
constexpr std::uint16_t kTrainsAtMost = 8;
// Between a train and what follows it, beyond the longest round trip, so that the queues that the
// train has filled are empty again: 50 ms drain 62 KB at 10 Mbit/s.
constexpr Duration kTrainPause = std::chrono::milliseconds(50);
// A train of which nothing has come for so long, beyond the longest round trip, is over. It is
// longer than a reflector holds the replies of a train whose last request is lost
// (EchoReflector::kHold).
constexpr Duration kTrainSilence = std::chrono::milliseconds(150);
// Closing packets sent until one is answered: ten in a row are lost once in 10^9 at 12 % loss.
constexpr std::size_t kClosingPackets = 10;
// At least this far apart, so that one burst of losses does not take them all.
constexpr Duration kClosingInterval = std::chrono::milliseconds(50);

}  // namespace

Measurement::Measurement(const Options& options, TimePoint start)
    : options_(options), next_at_(start), last_ping_at_(start) {
  assert(options.count >= 1 && options.count <= kMaxPings && options.interval > Duration::zero());
  options_.size = std::max(options_.size, smallest(options_.format));
  options_.train_size = std::max(options_.train_size, options_.size);
}

// --- sending

std::size_t Measurement::write(TimePoint now, Purpose purpose, std::span<std::byte> buffer) {
  const auto sequence = static_cast<std::uint32_t>(log_.size());
  log_.push_back({.sent = now, .purpose = purpose});
  wire::StampRequest request;
  request.sequence = sequence;
  request.sent = wire::to_stamp_time(now.time_since_epoch() + options_.wall);
  const bool in_train = purpose == Purpose::kTrain;
  const std::size_t size = in_train ? options_.train_size : options_.size;
  if (options_.format == Format::kStamp) return wire::write_stamp_request(buffer, request, size);
  wire::Echo echo;
  echo.request = request;
  echo.token = token_;
  if (in_train) {
    echo.hold = true;
    echo.train = train_;
    echo.index = static_cast<std::uint16_t>(train_count_ - train_left_);
    echo.count = static_cast<std::uint16_t>(train_count_);
  }
  return wire::write_echo(buffer,
                          {wire::PacketType::kEcho, options_.link, wire::kClearEpoch,
                           options_.session, std::uint64_t{sequence} + 1},
                          echo, size);
}

std::size_t Measurement::poll(TimePoint now, std::span<std::byte> buffer) {
  advance(now);
  if (phase_ == Phase::kTrain && train_left_ > 0) {
    const std::size_t size = write(now, Purpose::kTrain, buffer);
    --train_left_;
    train_heard_ = now;
    return size;
  }
  if (now < next_at_) return 0;
  if (phase_ == Phase::kPings && !all_pings_sent() && !wants_train()) {
    next_at_ += options_.interval;
    if (now - next_at_ > kCatchUp) next_at_ = now + options_.interval;
    ++pings_;
    last_ping_at_ = now;
    return write(now, Purpose::kPing, buffer);
  }
  if (phase_ == Phase::kClosing && closings_ < kClosingPackets) {
    ++closings_;
    next_at_ = now + std::max(options_.interval, kClosingInterval);
    if (closings_ == kClosingPackets) next_at_ = now + options_.timeout;
    return write(now, Purpose::kClosing, buffer);
  }
  return 0;
}

void Measurement::stop(TimePoint now) {
  options_.rate = false;
  options_.count = pings_;
  if (phase_ == Phase::kTrain) end_train(now);
  advance(now);
}

std::optional<TimePoint> Measurement::next_timeout() const {
  switch (phase_) {
    case Phase::kPings:
      if (wants_train()) return all_answered() ? next_at_ : std::max(next_at_, given_up_at());
      return all_pings_sent() ? given_up_at() : next_at_;
    case Phase::kTrain:
      return train_left_ > 0 ? train_heard_ : train_heard_ + slowest_ + kTrainSilence;
    case Phase::kClosing:
      return next_at_;
    case Phase::kDone:
      return std::nullopt;
  }
  return std::nullopt;
}

// --- phases

bool Measurement::wants_train() const {
  if (!options_.rate || train_ >= kTrainsAtMost || pings_answered_ == 0 ||
      rates_up_.size() >= kTrainsWanted) {
    return false;
  }
  return pings_answered_ >= std::min(kPingsBeforeTrains, options_.count);
}

void Measurement::advance(TimePoint now) {
  if (phase_ == Phase::kTrain && train_left_ == 0 &&
      (train_answered_ == train_count_ || now >= train_heard_ + slowest_ + kTrainSilence)) {
    end_train(now);
  }
  if (phase_ == Phase::kPings) {
    const bool settled = all_answered() || now >= given_up_at();
    if (wants_train()) {
      // No train while pings are under way, so that neither disturbs the other.
      if (settled && now >= next_at_) begin_train(now);
    } else if (settled && all_pings_sent()) {
      begin_closing(now);
    }
  }
  if (phase_ == Phase::kClosing && (closed_ || (closings_ == kClosingPackets && now >= next_at_))) {
    phase_ = Phase::kDone;
  }
}

void Measurement::begin_train(TimePoint now) {
  phase_ = Phase::kTrain;
  ++train_;
  train_count_ = train_length(rough_, options_.train_size + options_.ip_udp_bytes);
  train_left_ = train_count_;
  train_first_ = log_.size();
  train_answered_ = 0;
  train_heard_ = now;
}

void Measurement::end_train(TimePoint now) {
  phase_ = Phase::kPings;
  next_at_ = now + slowest_ + kTrainPause;
  const auto sent = std::span(log_).subspan(train_first_);
  const TrainRates rates =
      rates_of(sent, options_.train_size + options_.ip_udp_bytes, options_.format == Format::kEcho);
  rough_ = std::max(rough_, rates.rough);
  // A train that was too short tells no rate; rough_ then sets the length of the next one.
  if (rates.up) rates_up_.push_back(*rates.up);
  if (rates.down) rates_down_.push_back(*rates.down);
}

void Measurement::begin_closing(TimePoint now) {
  if (all_answered() || pings_answered_ == 0) {
    phase_ = Phase::kDone;
    return;
  }
  phase_ = Phase::kClosing;
  next_at_ = now;
  // A sequence number is left out: a reflector that repeats the requests' numbers shows the gap.
  log_.push_back({.sent = now, .purpose = Purpose::kSkipped});
}

// --- replies

std::optional<Measurement::Parsed> Measurement::parse(ByteView datagram) const {
  if (options_.format == Format::kStamp) {
    const auto reply = wire::parse_stamp_reply(datagram);
    if (!reply) return std::nullopt;
    return Parsed{*reply, {}, false};
  }
  const auto packet = wire::parse(datagram);
  if (!packet || packet->header.type != wire::PacketType::kEcho || !packet->echo.is_reply ||
      packet->header.link != options_.link) {
    return std::nullopt;
  }
  return Parsed{packet->echo.reply, packet->echo.token, packet->echo.hold};
}

// t2 - t1. The two clocks have an unknown offset and perhaps different epochs, so both instants are
// taken as the time since the first one of their clock.
Duration Measurement::up_of(const wire::StampReply& reply, TimePoint sent) {
  if (!reflector_start_) reflector_start_ = reply.received;
  const Duration received =
      wire::stamp_difference(reply.received, *reflector_start_, reply.error_estimate);
  return received - (sent - log_.front().sent);
}

void Measurement::note_times(SentPacket& packet, const wire::StampReply& reply,
                             TimePoint received) {
  packet.answered = true;
  packet.received = std::max(received, packet.sent);
  packet.counted = reply.sequence;
  const std::uint16_t format = reply.error_estimate;
  const Duration turnaround = std::clamp(wire::stamp_difference(reply.sent, reply.received, format),
                                         Duration::zero(), packet.received - packet.sent);
  packet.up = up_of(reply, packet.sent);
  packet.down = packet.received - packet.sent - turnaround - packet.up;
  if (reply.sequence != reply.request_sequence) differs_ = true;
  slowest_ = std::max(slowest_, std::min(packet.received - packet.sent, options_.timeout));
}

std::optional<Reply> Measurement::handle(TimePoint received, ByteView datagram) {
  const auto parsed = parse(datagram);
  const wire::StampReply* reply = parsed ? &parsed->reply : nullptr;
  if (reply == nullptr || reply->request_sequence >= log_.size()) {
    ++foreign_;
    return std::nullopt;
  }
  SentPacket& packet = log_[reply->request_sequence];
  const wire::StampTime sent = wire::to_stamp_time(packet.sent.time_since_epoch() + options_.wall);
  if (packet.purpose == Purpose::kSkipped || reply->request_sent != sent) {
    ++foreign_;
    return std::nullopt;
  }
  if (packet.answered) {
    ++duplicates_;
    if (counted_twice_.size() < kMaxPings) counted_twice_.push_back(reply->sequence);
    return std::nullopt;
  }
  token_ = parsed->token;
  note_times(packet, *reply, received);
  if (packet.purpose == Purpose::kTrain) {
    if (reply->request_sequence >= train_first_) {
      ++train_answered_;
      train_heard_ = std::max(train_heard_, received);
    }
    return std::nullopt;
  }
  if (packet.purpose == Purpose::kClosing) {
    closed_ = true;
    return std::nullopt;
  }
  return note_ping(packet, reply->request_sequence);
}

Reply Measurement::note_ping(const SentPacket& packet, std::uint32_t sequence) {
  ++pings_answered_;
  if (sequence < next_expected_) {
    ++reordered_;
  } else {
    next_expected_ = sequence + 1;
  }
  least_up_ = std::min(least_up_, packet.up);
  least_down_ = std::min(least_down_, packet.down);
  return {sequence, packet.rtt(), packet.up - least_up_, packet.down - least_down_,
          packet.received - packet.sent > options_.timeout};
}

// --- results

// Whether the reflector numbers what it receives. Ours always does. Another one shows it by a
// number that is not the request's; without any loss it cannot be seen and does not matter.
bool Measurement::reflector_counts() const { return options_.format == Format::kEcho || differs_; }

Summary Measurement::summary() const {
  Summary out;
  out.stateful = reflector_counts();
  out.duplicates = duplicates_;
  out.reordered = reordered_;
  summarise(log_, options_.timeout, counted_twice_, out);
  for (const SentPacket& packet : log_) {
    if (packet.purpose != Purpose::kTrain) continue;
    ++out.train_packets;
    out.train_answered += packet.answered ? 1 : 0;
  }
  out.trains = rates_up_.size();
  out.rate_up = median(rates_up_);
  out.rate_down = median(rates_down_);
  return out;
}

}  // namespace interneuron::probe
