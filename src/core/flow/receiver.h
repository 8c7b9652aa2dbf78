// The receiving side of one peer: duplicates dropped per path, messages put together in bounded
// memory and forgotten when they can no longer arrive by their deadline, and what feedback has to
// tell. Pure; thread-compatible.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include "core/wire/packet.h"
#include "interneuron/message.h"
#include "interneuron/units.h"

namespace interneuron::flow {

// What one path's packets have shown.
class PathReceiver {
 public:
  explicit PathReceiver(LinkId link) : link_(link) {}

  // False: seen before, or too old to tell.
  bool accept(TimePoint now, std::uint64_t number, bool counts_for_train, std::size_t ip_bytes);
  // The newest u of the peer on this path.
  void exchange(TimePoint now, PeerTime u);
  // The path's part of a feedback sent at `now`.
  wire::LinkReport report(TimePoint now) const;
  // A packet number was skipped since the last report.
  bool gap() const { return gap_; }
  void reported() { gap_ = false; }

 private:
  void extend_train(TimePoint now, std::uint64_t number, std::size_t ip_bytes);

  LinkId link_;
  std::uint64_t largest_ = 0;
  wire::AckBitmap bitmap_{};  // as on the wire: bit i = largest_ - 1 - i
  bool gap_ = false;
  std::optional<PeerTime> u_;
  TimePoint u_at_{};
  std::uint64_t train_start_ = 0;
  std::uint32_t train_packets_ = 0;
  std::size_t train_bytes_ = 0;  // after the first packet
  TimePoint train_first_{};
  TimePoint train_last_{};
};

// Upper bounds of own clock - origin clock, to tell when a message has expired (docs/paper.md,
// "Expiry at a receiver"). A round's t0 may be ours, the peer's or that of an origin further away,
// of whose clock nothing is known here.
struct ClockBounds {
  SessionId self{};
  SessionId peer{};
  std::optional<Duration> peer_hi_min;

  std::optional<Duration> above(SessionId origin) const {
    if (origin == self) return Duration::zero();
    if (origin == peer) return peer_hi_min;
    return std::nullopt;
  }
};

// Puts the messages of one peer together.
class Reassembler {
 public:
  // Incomplete messages of one peer hold at most this much; further ones are refused. Four raw
  // frames of three pipelined rounds fit six times, and the largest message with its header fits
  // once; chosen.
  static constexpr std::size_t kMaxBytes = kMaxMessageBytes + 64 * 1024;
  // And they are at most so many: a message may claim two bytes and live for an hour, and what we
  // keep beside its bytes is far more than that. 16 rounds of 8 variants, twice; chosen.
  static constexpr std::size_t kMaxPartials = 256;

  enum class Result : std::uint8_t { kStored, kComplete, kDuplicate, kRefused };
  struct Outcome {
    Result result{};
    Bytes message;  // when complete
  };
  Outcome add(TimePoint now, const wire::Data& data, const ClockBounds& clocks);

  // Forgets what can no longer arrive by its deadline; returns how many messages.
  std::size_t expire(TimePoint now);
  std::optional<TimePoint> next_timeout() const;
  std::size_t bytes() const { return bytes_; }
  void reset();

 private:
  struct Partial {
    std::unique_ptr<std::byte[]> bytes;  // not cleared: only what arrived is ever touched
    std::size_t capacity = 0;
    std::size_t size = 0;  // of the message, once its last piece is there
    std::uint16_t count = 0;
    std::uint16_t chunk = 0;
    std::uint16_t missing = 0;
    std::vector<bool> have;
    TimePoint expires{};
  };
  void bury(MessageId message);
  void refine_expiry(Partial& partial, ByteView first_piece, const ClockBounds& clocks);

  std::unordered_map<MessageId, Partial> partials_;
  std::unordered_set<MessageId> buried_;  // complete or expired: further pieces are duplicates
  std::deque<MessageId> burial_order_;
  std::size_t bytes_ = 0;
};

}  // namespace interneuron::flow
