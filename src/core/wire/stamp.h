// Test packets of RFC 8762 (STAMP), unauthenticated mode <-> bytes: what a Session-Sender sends
// (§4.2.1) and what a Session-Reflector answers (§4.3.1), 44 bytes each; a larger request gets an
// answer of its own size. Fields that must be zero are written so and ignored when read, as the RFC
// says. A parsed packet is always valid, but its times and numbers are whatever the sender wrote.
// Nothing throws. Pure.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "core/wire/bytes.h"
#include "interneuron/time.h"
#include "interneuron/units.h"

namespace interneuron::wire {

inline constexpr std::size_t kStampBytes = 44;
// RFC 8762 §4.1.
inline constexpr std::uint16_t kStampPort = 862;

// A clock's reading as on the wire: seconds in the upper half; in the lower 2^-32 s (NTP, RFC 5905
// §6) or ns (PTPv2), as the Z bit of the error estimate beside it says.
using StampTime = std::uint64_t;

// An error estimate (RFC 4656 §4.1.2): S (synchronised to UTC), Z (PTPv2 format), 6 bits scale, 8
// bits multiplier; the error is multiplier * 2^(scale - 32) s. A multiplier of 0 is malformed.
inline constexpr std::uint16_t kStampPtp = 0x4000;
// Ours: not synchronised, NTP format, an error of 2^-10 s, about 1 ms. No measurement behind this
// value: nobody vouches for the wall clock of a host, and every sender may ignore the field.
inline constexpr std::uint16_t kStampUnsynchronised = 0x1601;
// From the epoch of UNIX to that of NTP, 1900-01-01.
inline constexpr Duration kNtpToUnix = std::chrono::seconds(2'208'988'800);

// A clock's reading, not negative, in NTP format; seconds are modulo 2^32.
StampTime to_stamp_time(Duration reading);
// a - b of one clock, both in the format that `error_estimate` says; within 68 years.
Duration stamp_difference(StampTime a, StampTime b, std::uint16_t error_estimate);

struct StampRequest {
  // Counts from 0.
  std::uint32_t sequence = 0;
  // t1.
  StampTime sent = 0;
  std::uint16_t error_estimate = kStampUnsynchronised;
  friend bool operator==(const StampRequest&, const StampRequest&) = default;
};

struct StampReply {
  // A stateful reflector counts its replies of this session from 0; a stateless one repeats the
  // request's number.
  std::uint32_t sequence = 0;
  // t3.
  StampTime sent = 0;
  std::uint16_t error_estimate = kStampUnsynchronised;
  // t2.
  StampTime received = 0;
  // The request's fields as they came: its number, t1, its error estimate.
  std::uint32_t request_sequence = 0;
  StampTime request_sent = 0;
  std::uint16_t request_error_estimate = kStampUnsynchronised;
  // The time to live with which the request arrived.
  std::uint8_t request_ttl = 0;
  friend bool operator==(const StampReply&, const StampReply&) = default;
};

// The answer to `request`; the reflector still has to fill in its own number and both instants.
StampReply stamp_reply_to(const StampRequest& request, std::uint8_t ttl);

// From the first 44 bytes of a datagram. What follows them is padding (RFC 8762 §4.2) or TLVs
// (RFC 8972) and is not looked at.
std::optional<StampRequest> parse_stamp_request(ByteView datagram);
std::optional<StampReply> parse_stamp_reply(ByteView datagram);
// Each writes one datagram and returns its size in bytes. The buffer must hold it, which is
// asserted. A request is padded with zeros to `size`, at least kStampBytes.
std::size_t write_stamp_request(std::span<std::byte> out, const StampRequest& request,
                                std::size_t size);
// `beyond` is what the request had behind its first 44 bytes; it is reflected as it came (RFC 8762
// §4.3).
std::size_t write_stamp_reply(std::span<std::byte> out, const StampReply& reply, ByteView beyond);

// The 44 bytes alone, for packets that carry them inside (docs/wire_format.md, "Echo (type 4)").
void put_stamp(Writer& w, const StampRequest& request);
void put_stamp(Writer& w, const StampReply& reply);
std::optional<StampRequest> get_stamp_request(Reader& r);
std::optional<StampReply> get_stamp_reply(Reader& r);

}  // namespace interneuron::wire
