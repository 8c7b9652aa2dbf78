#include "core/probe/reflectors.h"

#include <algorithm>
#include <array>

#include "core/wire/packet.h"

namespace interneuron::probe {
namespace {

// Where the bytes of a STAMP reply are that must be zero (RFC 8762 §4.3.1), but for the two behind
// its error estimate, which RFC 8972 §3 gives to the session's identifier.
constexpr std::array<std::size_t, 5> kReplyZeros{38, 39, 41, 42, 43};

// All marks of a reply: valid error estimates of both sides, the instant of reception, and zeros
// where a reply must have them. A request has zeros in place of the first two.
bool is_stamp_reply(ByteView datagram) {
  const auto reply = wire::parse_stamp_reply(datagram);
  return reply && reply->received != 0 && std::ranges::all_of(kReplyZeros, [&](std::size_t at) {
           return datagram[at] == std::byte{0};
         });
}

}  // namespace

bool StampReflector::from_reflector(const Request& request) const {
  const std::uint16_t port = sender_port(request.from);
  if (port == wire::kStampPort || (port != 0 && port == port_)) return true;
  if (is_stamp_reply(request.bytes)) return true;
  const auto packet = wire::parse(request.bytes);
  return packet && packet->header.type == wire::PacketType::kEcho && packet->echo.is_reply;
}

StampReflector::Session& StampReflector::session_of(const Request& request) {
  const auto known = std::ranges::find_if(sessions_, [&request](const Session& s) {
    return s.nic == request.nic && s.from == request.from;
  });
  if (known != sessions_.end()) {
    if (request.received - known->heard >= kSessionSilence) known->answers = 0;
    return *known;
  }
  if (sessions_.size() >= kMaxSessions) {
    sessions_.erase(std::ranges::min_element(sessions_, {}, &Session::heard));
  }
  return sessions_.emplace_back(Session{request.nic, request.from, 0, request.received});
}

std::size_t StampReflector::answer(const Request& request, TimePoint sent, Duration wall,
                                   std::span<std::byte> out) {
  const auto parsed = wire::parse_stamp_request(request.bytes);
  if (!parsed || out.size() < request.bytes.size() || from_reflector(request)) return 0;
  if (!limit_.allow(request.received, request.from)) return 0;
  wire::StampReply reply = wire::stamp_reply_to(*parsed, request.ttl);
  if (stateful_) {
    Session& session = session_of(request);
    session.heard = request.received;
    reply.sequence = session.answers++;
  }
  reply.received = wire::to_stamp_time(request.received.time_since_epoch() + wall);
  reply.sent = wire::to_stamp_time(sent.time_since_epoch() + wall);
  return wire::write_stamp_reply(out, reply, request.bytes.subspan(wire::kStampBytes));
}

}  // namespace interneuron::probe
