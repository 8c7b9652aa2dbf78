#include "core/probe/reflectors.h"

#include <algorithm>

#include "core/base/earliest.h"

namespace interneuron::probe {
namespace {

wire::StampTime stamp_time(TimePoint t) { return wire::to_stamp_time(t.time_since_epoch()); }

}  // namespace

EchoReflector::Path& EchoReflector::path_of(TimePoint now, const wire::PacketHeader& header,
                                            const Datagram& datagram) {
  const auto known = std::ranges::find_if(paths_, [&](const Path& p) {
    return p.session == header.session && p.link == header.link && p.nic == datagram.link &&
           p.from == datagram.from;
  });
  if (known != paths_.end()) {
    known->heard = now;
    return *known;
  }
  if (paths_.size() >= kMaxPaths) {
    const auto oldest = std::ranges::min_element(paths_, {}, &Path::heard);
    release(*oldest);
    paths_.erase(oldest);
  }
  Path path;
  path.nic = datagram.link;
  path.from = datagram.from;
  path.session = header.session;
  path.link = header.link;
  path.heard = now;
  return paths_.emplace_back(std::move(path));
}

bool EchoReflector::may_hold(const Path& path) const {
  if (!path.held.empty()) return true;
  std::size_t all = 0;
  std::size_t of_host = 0;
  for (const Path& p : paths_) {
    if (p.held.empty()) continue;
    ++all;
    if (source_of(p.from) == source_of(path.from)) ++of_host;
  }
  return all < kMaxHeldTrains && of_host < kMaxHeldTrainsOfHost;
}

bool EchoReflector::may_delay(const Address& to) const {
  const auto of_host = std::ranges::count_if(
      delayed_, [&to](const auto& entry) { return source_of(entry.second.to) == source_of(to); });
  return delayed_.size() < kMaxDelayed && std::cmp_less(of_host, kMaxDelayedOfHost);
}

bool EchoReflector::take(TimePoint now, const wire::Packet& packet, const Datagram& datagram,
                         const Asker& asker) {
  const wire::Echo& request = packet.echo;
  if (request.is_reply || packet.header.session == self_) return false;
  if (sender_port(datagram.from) == wire::kStampPort) return false;
  if (!limit_.allow(now, datagram.from)) return false;
  Path& path = path_of(now, packet.header, datagram);
  // Counted before it may be dropped: what is dropped here did arrive.
  const std::uint32_t sequence = path.requests++;
  if (waiting() - delayed_.size() >= kMaxWaiting) return false;

  Reply reply{path.nic, path.from, path.session, path.link, request, datagram.bytes.size()};
  reply.echo.is_reply = true;
  reply.echo.token = asker.token;
  reply.echo.reply = wire::stamp_reply_to(request.request, 0);
  reply.echo.reply.sequence = sequence;
  reply.echo.reply.received = stamp_time(now);

  // The next train says that the one before is over.
  if (request.train != path.train) release(path);
  if (asker.is_proved && request.delay > 0 && may_delay(path.from)) {
    delayed_.emplace(now + std::chrono::seconds(request.delay), std::move(reply));
    return true;
  }
  if (!asker.is_proved || !request.hold || !may_hold(path)) {
    ready_.push_back(std::move(reply));
    return true;
  }
  if (path.held.empty()) path.train_began = now;
  path.train = request.train;
  path.held.push_back(std::move(reply));
  if (request.index + 1 == request.count) release(path);
  return true;
}

void EchoReflector::release(Path& path) {
  std::ranges::move(path.held, std::back_inserter(ready_));
  path.held.clear();
}

void EchoReflector::release_due(TimePoint now) {
  for (Path& path : paths_) {
    if (!path.held.empty() && release_at(path) <= now) release(path);
  }
  while (!delayed_.empty() && delayed_.begin()->first <= now) {
    ready_.push_back(std::move(delayed_.extract(delayed_.begin()).mapped()));
  }
}

TimePoint EchoReflector::release_at(const Path& path) {
  return std::min(path.heard + kHold, path.train_began + kHoldAtMost);
}

void EchoReflector::remove_link(LinkId nic) {
  std::erase_if(paths_, [nic](const Path& p) { return p.nic == nic; });
  std::erase_if(delayed_, [nic](const auto& entry) { return entry.second.nic == nic; });
  std::erase_if(ready_, [nic](const Reply& r) { return r.nic == nic; });
}

std::optional<TimePoint> EchoReflector::next_timeout() const {
  std::optional<TimePoint> next;
  if (!delayed_.empty()) next = delayed_.begin()->first;
  for (const Path& path : paths_) {
    if (!path.held.empty()) next = earliest(next, release_at(path));
  }
  return next;
}

std::optional<EchoReflector::Leaving> EchoReflector::poll(TimePoint now,
                                                          std::span<std::byte> buffer) {
  release_due(now);
  if (ready_.empty()) return std::nullopt;
  Reply& reply = ready_.front();
  reply.echo.reply.sent = stamp_time(now);
  const wire::PacketHeader header{wire::PacketType::kEcho, reply.link, wire::kClearEpoch, self_,
                                  std::uint64_t{reply.echo.reply.sequence} + 1};
  const std::size_t size = wire::write_echo(buffer, header, reply.echo, reply.size);
  const Leaving leaving{{reply.nic, reply.to, size}, reply.session};
  ready_.pop_front();
  return leaving;
}

std::size_t EchoReflector::waiting() const {
  std::size_t count = ready_.size() + delayed_.size();
  for (const Path& path : paths_) count += path.held.size();
  return count;
}

}  // namespace interneuron::probe
