#include "core/wire/stamp.h"

#include <algorithm>
#include <cassert>

namespace interneuron::wire {
namespace {

constexpr std::uint64_t kNsPerSecond = 1'000'000'000;
constexpr std::uint64_t kLowerHalf = 0xffff'ffff;
// Bytes of a request that must be zero (RFC 8762 §4.2.1).
constexpr std::size_t kRequestZeros = 30;

bool valid(std::uint16_t error_estimate) { return (error_estimate & 0xff) != 0; }

}  // namespace

StampTime to_stamp_time(Duration reading) {
  const auto ns = static_cast<std::uint64_t>(std::max<std::int64_t>(reading.count(), 0));
  const std::uint64_t fraction = ((ns % kNsPerSecond) << 32) / kNsPerSecond;
  return ((ns / kNsPerSecond) << 32) | fraction;
}

Duration stamp_difference(StampTime a, StampTime b, std::uint16_t error_estimate) {
  if ((error_estimate & kStampPtp) != 0) {
    const auto seconds = static_cast<std::int32_t>(static_cast<std::uint32_t>(a >> 32) - (b >> 32));
    return Duration{std::int64_t{seconds} * static_cast<std::int64_t>(kNsPerSecond) +
                    static_cast<std::int64_t>(a & kLowerHalf) -
                    static_cast<std::int64_t>(b & kLowerHalf)};
  }
  const std::uint64_t difference = a - b;
  const auto seconds = static_cast<std::int32_t>(difference >> 32);
  // Rounded, so that instants a whole number of ns apart come back as they went.
  const std::uint64_t ns = ((difference & kLowerHalf) * kNsPerSecond + (1ULL << 31)) >> 32;
  return Duration{std::int64_t{seconds} * static_cast<std::int64_t>(kNsPerSecond) +
                  static_cast<std::int64_t>(ns)};
}

StampReply stamp_reply_to(const StampRequest& request, std::uint8_t ttl) {
  StampReply reply;
  reply.sequence = request.sequence;
  reply.request_sequence = request.sequence;
  reply.request_sent = request.sent;
  reply.request_error_estimate = request.error_estimate;
  reply.request_ttl = ttl;
  return reply;
}

void put_stamp(Writer& w, const StampRequest& request) {
  w.put(request.sequence);
  w.put(request.sent);
  w.put(request.error_estimate);
  w.put_zeros(kRequestZeros);
}

void put_stamp(Writer& w, const StampReply& reply) {
  w.put(reply.sequence);
  w.put(reply.sent);
  w.put(reply.error_estimate);
  w.put_zeros(2);
  w.put(reply.received);
  w.put(reply.request_sequence);
  w.put(reply.request_sent);
  w.put(reply.request_error_estimate);
  w.put_zeros(2);
  w.put(reply.request_ttl);
  w.put_zeros(3);
}

std::optional<StampRequest> get_stamp_request(Reader& r) {
  StampRequest request;
  request.sequence = r.get<std::uint32_t>();
  request.sent = r.get<std::uint64_t>();
  request.error_estimate = r.get<std::uint16_t>();
  for (std::size_t i = 0; i < kRequestZeros / 2; ++i) r.get<std::uint16_t>();
  if (!r.ok() || !valid(request.error_estimate)) return std::nullopt;
  return request;
}

std::optional<StampReply> get_stamp_reply(Reader& r) {
  StampReply reply;
  reply.sequence = r.get<std::uint32_t>();
  reply.sent = r.get<std::uint64_t>();
  reply.error_estimate = r.get<std::uint16_t>();
  r.get<std::uint16_t>();
  reply.received = r.get<std::uint64_t>();
  reply.request_sequence = r.get<std::uint32_t>();
  reply.request_sent = r.get<std::uint64_t>();
  reply.request_error_estimate = r.get<std::uint16_t>();
  r.get<std::uint16_t>();
  reply.request_ttl = r.get<std::uint8_t>();
  r.get<std::uint8_t>();
  r.get<std::uint16_t>();
  if (!r.ok() || !valid(reply.error_estimate) || !valid(reply.request_error_estimate)) {
    return std::nullopt;
  }
  return reply;
}

std::optional<StampRequest> parse_stamp_request(ByteView datagram) {
  Reader r(datagram);
  return get_stamp_request(r);
}

std::optional<StampReply> parse_stamp_reply(ByteView datagram) {
  Reader r(datagram);
  return get_stamp_reply(r);
}

std::size_t write_stamp_request(std::span<std::byte> out, const StampRequest& request,
                                std::size_t size) {
  Writer w(out);
  put_stamp(w, request);
  w.put_zeros(std::max(size, kStampBytes) - kStampBytes);
  assert(w.ok());
  return w.size();
}

std::size_t write_stamp_reply(std::span<std::byte> out, const StampReply& reply, ByteView beyond) {
  Writer w(out);
  put_stamp(w, reply);
  w.put_bytes(beyond);
  assert(w.ok());
  return w.size();
}

}  // namespace interneuron::wire
