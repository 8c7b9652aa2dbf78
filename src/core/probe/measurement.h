// Measures one path to a reflector: decides which packet leaves when, and keeps what its replies
// say. `interneuron probe` drives it over one socket.
//
// It pings at a steady interval. Once the path has answered, it also sends a few trains for the
// rate and keeps pings away from them. At the end it asks how many packets have arrived, so that
// losses there and back can be told apart.
//
// Drive it like an Endpoint: handle() what came in, then poll() until it gives nothing, then wait
// until next_timeout(). Pure; thread-compatible; never throws. Memory: 40 bytes for each of
// Options::count pings and of the packets of eight trains.
//
// Replies are believed only if they repeat the exact send instant of a packet in the log, so an
// attacker who does not see the packets can only raise foreign(). One on the path, or a lying
// reflector, can report any delay, loss or rate; nothing but the measurement's own result depends
// on it.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/probe/packet_log.h"
#include "core/probe/summary.h"
#include "core/wire/packet.h"
#include "interneuron/sizes.h"
#include "interneuron/units.h"

namespace interneuron::probe {

enum class Format {
  // Our own packets (docs/wire_format.md), which a roadside unit answers on its normal port.
  kEcho,
  // RFC 8762 without authentication, which any reflector answers; tells no rate of the way back.
  kStamp,
};

// The log of so many pings takes 40 MB; at the default interval they last 5.5 hours.
inline constexpr std::size_t kMaxPings = 1'000'000;
// The smallest packet of a format: bytes of UDP payload.
constexpr std::size_t smallest(Format format) {
  return format == Format::kEcho ? wire::kEchoBytes : wire::kStampBytes;
}

struct Options {
  Format format = Format::kEcho;
  // Pings to send, 1 … kMaxPings.
  std::size_t count = 100;
  // Between two pings, > 0.
  Duration interval = std::chrono::milliseconds(20);
  // A reply that takes longer counts as late; a ping without one is waited for this long.
  Duration timeout = std::chrono::seconds(1);
  // Bytes of UDP payload of a ping; raised to smallest(format).
  std::size_t size = 100;
  // Whether to send trains, too.
  bool rate = true;
  // Bytes of UDP payload of a train's packets; raised to `size`.
  std::size_t train_size = kMaxDatagramBytes;
  // Bytes that IP and UDP add to each packet: kIpv4UdpBytes or kIpv6UdpBytes.
  std::size_t ip_udp_bytes = kIpv4UdpBytes;
  // Our session in the echoes' headers; not 0.
  SessionId session{};
  // The path's name in the echoes' headers.
  LinkId link{};
  // Added to `now` for the time on the wire; the sum must not be negative.
  Duration wall{};
};

// The first reply to a ping.
struct Reply {
  // The ping's number on the wire.
  std::uint32_t sequence = 0;
  Duration rtt{};
  // One-way delays there and back, above the least so far.
  Duration variation_up{};
  Duration variation_down{};
  // It took longer than Options::timeout.
  bool late = false;
};

class Measurement {
 public:
  Measurement(const Options& options, TimePoint start);

  // Writes the next packet that is due and returns its size in bytes; 0: none is due.
  std::size_t poll(TimePoint now, std::span<std::byte> buffer);
  // A datagram came in; the kernel had it at `received`. Gives the first reply to a ping, and
  // nothing for every other datagram.
  std::optional<Reply> handle(TimePoint received, ByteView datagram);
  // No more pings; what is under way is waited for.
  void stop(TimePoint now);
  // Nothing when it is over.
  std::optional<TimePoint> next_timeout() const;
  bool done() const { return phase_ == Phase::kDone; }

  Summary summary() const;
  std::size_t pings_sent() const { return pings_; }
  std::size_t pings_answered() const { return pings_answered_; }
  // Datagrams that answer no packet of ours.
  std::uint64_t foreign() const { return foreign_; }
  const PacketLog& log() const { return log_; }

 private:
  enum class Phase { kPings, kTrain, kClosing, kDone };
  struct Parsed {
    wire::StampReply reply;
    wire::Token token{};
    bool held = false;
  };

  std::optional<Parsed> parse(ByteView datagram) const;
  void advance(TimePoint now);
  void begin_train(TimePoint now);
  void end_train(TimePoint now);
  void begin_closing(TimePoint now);
  bool wants_train() const;
  bool all_pings_sent() const { return pings_ >= options_.count; }
  bool all_answered() const { return pings_answered_ == pings_; }
  TimePoint given_up_at() const { return last_ping_at_ + options_.timeout; }
  std::size_t write(TimePoint now, Purpose purpose, std::span<std::byte> buffer);
  void note_times(SentPacket& packet, const wire::StampReply& reply, TimePoint received);
  Duration up_of(const wire::StampReply& reply, TimePoint sent);
  Reply note_ping(const SentPacket& packet, std::uint32_t sequence);
  bool reflector_counts() const;

  Options options_;
  Phase phase_ = Phase::kPings;
  PacketLog log_;
  std::size_t pings_ = 0;
  std::size_t pings_answered_ = 0;
  // When the next ping, train or closing packet leaves.
  TimePoint next_at_;
  // When the newest ping left.
  TimePoint last_ping_at_;
  // The longest round trip so far, the reflector's own time included; at most Options::timeout.
  Duration slowest_{};
  std::uint32_t next_expected_ = 0;
  std::size_t reordered_ = 0;
  std::size_t duplicates_ = 0;
  // The reflector's numbers of duplicates, at most kMaxPings of them.
  std::vector<std::uint32_t> counted_twice_;
  // What the newest reply asks the next echo to bring, so that trains are held.
  wire::Token token_{};
  std::optional<wire::StampTime> reflector_start_;
  // The reflector gave a number that was not the request's, so it counts what it receives.
  bool differs_ = false;
  // A closing packet was answered.
  bool closed_ = false;
  std::uint64_t foreign_ = 0;
  Duration least_up_ = Duration::max();
  Duration least_down_ = Duration::max();

  // The train under way, or the last one; trains are numbered from 1.
  std::uint16_t train_ = 0;
  // Its first packet's index into the log.
  std::size_t train_first_ = 0;
  // Its packets: all of them, those not sent yet, those answered.
  std::size_t train_count_ = 0;
  std::size_t train_left_ = 0;
  std::size_t train_answered_ = 0;
  // When its newest packet was sent or its newest reply came in.
  TimePoint train_heard_{};
  // The fastest rate that any train seemed to show, however short it was; 0: none yet.
  DataRate rough_{};
  std::vector<DataRate> rates_up_;
  std::vector<DataRate> rates_down_;
  std::size_t closings_ = 0;
};

}  // namespace interneuron::probe
