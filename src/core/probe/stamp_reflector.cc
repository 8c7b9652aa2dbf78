#include "core/probe/stamp_reflector.h"

#include <algorithm>

namespace interneuron::probe {

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
  if (!parsed || out.size() < request.bytes.size()) return 0;
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
