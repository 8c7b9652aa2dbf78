// The measuring machine of one path: which packet leaves when, what its replies say. It pings at a
// steady interval; once the path is known to answer it also sends a few trains for the rate, and
// keeps pings away from them; at the end it asks how many packets have arrived, so that losses
// there and back can be told apart.
//
// Drive it like an Endpoint: handle() what came in, then poll() until it gives nothing, then wait
// until next_timeout(). Pure; thread-compatible; memory for Options::count packets.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/probe/packet_log.h"
#include "core/probe/summary.h"
#include "core/wire/packet.h"
#include "interneuron/units.h"

namespace interneuron::probe {

enum class Format {
  kEcho,   // our own packets (docs/wire_format.md); a roadside unit's normal port answers
  kStamp,  // RFC 8762, unauthenticated; any reflector answers. No rate of the way back.
};

inline constexpr std::size_t kMaxPings = 1'000'000;  // 60 MB of log; chosen
// The smallest packet of a format, UDP payload.
constexpr std::size_t smallest(Format format) {
  return format == Format::kEcho ? wire::kEchoBytes : wire::kStampBytes;
}

struct Options {
  Format format = Format::kEcho;
  std::size_t count = 100;  // pings, 1 … kMaxPings
  Duration interval = std::chrono::milliseconds(20);
  Duration timeout = std::chrono::seconds(1);  // later replies are late
  std::size_t size = 100;                      // of a ping, bytes of UDP payload
  bool rate = true;
  std::size_t train_size = 1400;  // of a train's packets, the same
  std::size_t ip_udp_bytes = 28;  // what IP and UDP add: 28 or 48
  SessionId session{};            // not 0
  LinkId link{};                  // echoes name the path by it
  Duration wall{};                // what makes `now` the time on the wire; not negative then
};

// The first reply to a ping.
struct Reply {
  std::uint32_t sequence = 0;  // as on the wire
  Duration rtt{};
  // One-way delays above the least so far.
  Duration variation_up{};
  Duration variation_down{};
  bool late = false;
};

class Measurement {
 public:
  Measurement(const Options& options, TimePoint start);

  // Writes the next packet that is due and returns its size; 0: none is.
  std::size_t poll(TimePoint now, std::span<std::byte> buffer);
  // `received`: when the kernel had it. Nothing: no reply to a ping, or not the first one.
  std::optional<Reply> handle(TimePoint received, ByteView datagram);
  // No more pings; what is under way is waited for.
  void stop(TimePoint now);
  // Nothing when it is over.
  std::optional<TimePoint> next_timeout() const;
  bool done() const { return phase_ == Phase::kDone; }

  Summary summary() const;
  std::size_t pings_sent() const { return pings_; }
  std::size_t pings_answered() const { return pings_answered_; }
  std::uint64_t foreign() const { return foreign_; }  // datagrams that answer nothing of ours
  const PacketLog& log() const { return log_; }

 private:
  enum class Phase { kPings, kTrain, kClosing, kDone };
  struct Parsed {
    wire::StampReply reply;
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
  TimePoint next_at_;       // of the next ping, train or closing packet
  TimePoint last_ping_at_;  // sent
  Duration slowest_{};      // round trip so far, the reflector's time included
  std::uint32_t next_expected_ = 0;
  std::size_t reordered_ = 0;
  std::size_t duplicates_ = 0;
  std::vector<std::uint32_t> counted_twice_;  // the reflector's numbers of duplicates
  std::optional<wire::StampTime> reflector_start_;
  bool differs_ = false;  // the reflector gave a number that was not the request's
  bool closed_ = false;   // a closing packet was answered
  std::uint64_t foreign_ = 0;
  Duration least_up_ = Duration::max();
  Duration least_down_ = Duration::max();

  // The train under way, or the last one.
  std::uint16_t train_ = 0;
  std::size_t train_first_ = 0;  // index into the log
  std::size_t train_count_ = 0;
  std::size_t train_left_ = 0;  // not sent yet
  std::size_t train_answered_ = 0;
  TimePoint train_heard_{};  // or sent
  DataRate rough_{};
  std::vector<DataRate> rates_up_;
  std::vector<DataRate> rates_down_;
  std::size_t closings_ = 0;
};

}  // namespace interneuron::probe
