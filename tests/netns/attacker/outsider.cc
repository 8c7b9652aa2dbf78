#include "tests/netns/attacker/outsider.h"

#include <poll.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <limits>
#include <memory>
#include <random>
#include <stdexcept>

#include "core/wire/packet.h"
#include "interneuron/sizes.h"
#include "tests/netns/attacker/initiations.h"
#include "tests/netns/attacker/recorded.h"
#include "tests/netns/attacker/sealed_channel.h"
#include "tests/netns/attacker/spoof.h"

namespace interneuron::attacker {
namespace {

// He looks on for so long before he begins, so that there is something to repeat.
constexpr double kLooksOnSeconds = 1;
// What a generator that was kept waiting makes good at once: what buffers of sockets hold.
constexpr double kMostAtOnceSeconds = 0.02;
// Most of what is drawn at random is about as small as feedback, so that it is many.
constexpr std::size_t kSmall = 200;

enum class Kind : std::uint8_t {
  // Random bytes from anywhere.
  kRandom,
  // A header that could be one of ours, random bytes behind it, in the peer's name.
  kHeader,
  // A packet that was recorded: without its end, with one bit changed, as it was, as it was over
  // another link or from another address, and with the last number there is.
  kTruncated,
  kFlipped,
  kReplayed,
  kOtherLink,
  kOtherSource,
  kLastNumber,
  // A packet of a former life, sealed with keys that are no longer used.
  kOldKeys,
  // In the clear, in the peer's name.
  kClear,
  // A handshake that was recorded, in the peer's name and from elsewhere.
  kHandshake,
  // A peer that says to have begun a new life, from any of its ports.
  kRestart,
};
constexpr std::array<const char*, 12> kKinds{
    "random",       "header",      "truncated", "flipped", "replayed",  "other_link",
    "other_source", "last_number", "old_keys",  "clear",   "handshake", "restart"};

// Who is attacked, and what was seen of the packets that he is sent over each link.
struct Target {
  const char* name = "";
  std::vector<std::unique_ptr<SpoofSocket>> sockets;
  std::vector<std::unique_ptr<Recorder>> seen;
  std::vector<Recorded> old;
  std::array<std::uint64_t, kKinds.size()> sent{};

  std::uint64_t packets() const {
    std::uint64_t sum = 0;
    for (const auto& socket : sockets) sum += socket->packets();
    return sum;
  }
};

class Outsider {
 public:
  explicit Outsider(const OutsiderOptions& o)
      : o_(o),
        random_(o.seed),
        initiations_(read_public_key(o.road_key), random_),
        net_(parse_host(o.spoofed) & 0xFFFF0000U) {
    if (o.road_nics.empty() || o.road_nics.size() != o.vehicle_nics.size()) {
      throw std::runtime_error("give as many --vehicle-nic as --road-nic, one of each at least");
    }
    const auto old = o.old.empty() ? std::vector<Recorded>{} : read_capture(o.old);
    targets_[0] = target("road", o.road_nics, o.vehicle_nics);
    targets_[1] = target("vehicle", o.vehicle_nics, o.road_nics);
    old_ = old;
  }

  bool look_on() {
    const TimePoint began = now();
    while (seconds_between(began, now()) < kLooksOnSeconds) record();
    for (Target& target : targets_) {
      for (const auto& seen : target.seen) {
        if (seen->newest() == nullptr) return false;
      }
    }
    // To whom what is old was sent.
    for (const Recorded& packet : old_) {
      for (Target& target : targets_) {
        for (const auto& seen : target.seen) {
          if (seen->newest()->to.host == packet.to.host) target.old.push_back(packet);
        }
      }
    }
    return true;
  }
  void run() {
    const TimePoint began = now();
    double done = 0;
    while (done < o_.packets) {
      record();
      const double elapsed = seconds_between(began, now());
      const double most = done + kMostAtOnceSeconds * o_.pps;
      const double due = std::min({elapsed * o_.pps, o_.packets, most});
      for (; done < due; ++done) send_one();
      for (Target& target : targets_) {
        for (const auto& socket : target.sockets) socket->flush();
      }
      ::poll(nullptr, 0, 1);
    }
    seconds_ = seconds_between(began, now());
  }
  void tell() const {
    std::printf("{\"seconds\": %.3f", seconds_);
    for (const Target& target : targets_) {
      std::printf(", \"%s\": {\"packets\": %llu", target.name,
                  static_cast<unsigned long long>(target.packets()));
      for (std::size_t i = 0; i < kKinds.size(); ++i) {
        std::printf(", \"%s\": %llu", kKinds[i], static_cast<unsigned long long>(target.sent[i]));
      }
      std::printf("}");
    }
    std::printf("}\n");
  }

 private:
  static Target target(const char* name, const std::vector<std::string>& to,
                       const std::vector<std::string>& from) {
    Target out;
    out.name = name;
    for (const std::string& nic : to) {
      require_confined(nic);
      out.sockets.push_back(std::make_unique<SpoofSocket>(nic));
    }
    for (const std::string& nic : from) out.seen.push_back(std::make_unique<Recorder>(nic));
    return out;
  }
  void record() {
    for (Target& target : targets_) {
      for (const auto& seen : target.seen) seen->turn(now());
    }
  }
  Place elsewhere() {
    const std::uint64_t drawn = random_();
    return {net_ | static_cast<std::uint32_t>(drawn & 0xFFFF),
            static_cast<std::uint16_t>(1024 + (drawn >> 16) % 60'000)};
  }
  Place other_port(Place place) {
    place.port = static_cast<std::uint16_t>(1024 + random_() % 60'000);
    return place;
  }
  Bytes draw(std::size_t size) {
    Bytes out(size);
    for (std::byte& byte : out) byte = static_cast<std::byte>(random_());
    return out;
  }
  std::size_t draw_size() {
    const std::size_t most = random_() % 8 == 0 ? kMaxDatagramBytes + 60 : kSmall;
    return 1 + random_() % most;
  }

  // A kind that has nothing to send (nothing of it was recorded) gives its turn to the next one.
  void send_one() {
    Target& target = targets_[turn_ % 2];
    const std::size_t link = turn_ / 2 % target.sockets.size();
    for (std::size_t tries = 0; tries < kKinds.size(); ++tries) {
      const std::size_t kind = turn_++ / 4 % kKinds.size();
      if (send(target, link, static_cast<Kind>(kind))) {
        ++target.sent[kind];
        return;
      }
    }
  }
  bool send(Target& target, std::size_t link, Kind kind) {
    SpoofSocket& out = *target.sockets[link];
    const Place peer = target.seen[link]->newest()->from;
    const Place to = target.seen[link]->newest()->to;
    switch (kind) {
      case Kind::kRandom:
        out.add(random_() % 2 == 0 ? peer : elsewhere(), to, draw(draw_size()));
        return true;
      case Kind::kHeader:
        out.add(peer, to, guessed(*target.seen[link]->newest()));
        return true;
      case Kind::kOldKeys: {
        if (target.old.empty()) return false;
        const Recorded& packet = target.old[random_() % target.old.size()];
        out.add(random_() % 2 == 0 ? packet.from : peer, to, packet.payload);
        return true;
      }
      case Kind::kClear:
        out.add(peer, to, clear(*target.seen[link]->newest()));
        return true;
      case Kind::kHandshake:
        return send_handshake(target, link, peer, to);
      case Kind::kRestart:
        return send_restart(target, link, peer, to);
      default:
        return send_recorded(target, link, kind, peer, to);
    }
  }
  bool send_recorded(Target& target, std::size_t link, Kind kind, Place peer, Place to) {
    const Recorded* packet = target.seen[link]->any(now(), random_);
    if (packet == nullptr || packet->payload.size() < wire::kPacketOverhead) return false;
    Bytes bytes = packet->payload;
    std::size_t over = link;
    if (kind == Kind::kTruncated) bytes.resize(1 + random_() % (bytes.size() - 1));
    if (kind == Kind::kFlipped) {
      bytes[random_() % bytes.size()] ^= static_cast<std::byte>(1U << random_() % 8);
    }
    if (kind == Kind::kLastNumber) {
      wire::set_number(bytes, std::numeric_limits<std::uint64_t>::max());
    }
    if (kind == Kind::kOtherSource) peer = random_() % 2 == 0 ? elsewhere() : other_port(peer);
    if (kind == Kind::kOtherLink) {
      over = (link + 1) % target.sockets.size();
      peer = target.seen[over]->newest()->from;
      to = target.seen[over]->newest()->to;
    }
    target.sockets[over]->add(peer, to, bytes);
    return true;
  }
  // What was recorded since the first packet, or of the former life.
  bool send_handshake(Target& target, std::size_t link, Place peer, Place to) {
    const std::vector<Recorded>& recent = target.seen[link]->handshakes();
    if (!recent.empty() && random_() % 4 != 0) {
      const Recorded& packet = recent[random_() % recent.size()];
      if (now() - packet.at < std::chrono::milliseconds(200)) return false;
      target.sockets[link]->add(random_() % 2 == 0 ? peer : elsewhere(), to, packet.payload);
      return true;
    }
    std::size_t tries = std::min<std::size_t>(target.old.size(), 64);
    for (std::size_t i = 0; i < tries; ++i) {
      const Recorded& packet = target.old[i];
      const auto header = wire::peek(packet.payload);
      if (!header || !wire::is_handshake(header->type) || header->epoch != 0) continue;
      if (random_() % 2 == 0 && i + 1 < tries) continue;
      target.sockets[link]->add(random_() % 2 == 0 ? peer : elsewhere(), to, packet.payload);
      return true;
    }
    return false;
  }
  // At the road: initiations that fit its key, which it may answer with a cookie to the peer; at
  // the vehicle: answers to what it did not ask. And packets in the clear of new sessions.
  bool send_restart(Target& target, std::size_t link, Place peer, Place to) {
    SpoofSocket& out = *target.sockets[link];
    if (random_() % 2 == 0) {
      out.add(other_port(peer), to, hello(static_cast<std::uint32_t>(random_()) | 1));
    } else if (&target == &targets_[0]) {
      const ByteView asks = random_() % 2 == 0 ? initiations_.random() : initiations_.whole();
      out.add(other_port(peer), to, asks);
    } else {
      const bool is_cookie = random_() % 2 == 0;
      Bytes bytes = draw(is_cookie ? crypto::kCookieBytes : crypto::kResponseBytes);
      wire::write_header(
          bytes, {.type = is_cookie ? wire::PacketType::kCookie : wire::PacketType::kResponse,
                  .session = {session_of(*target.seen[link]->newest())},
                  .number = 1 + random_() % 3});
      out.add(random_() % 2 == 0 ? peer : other_port(peer), to, bytes);
    }
    return true;
  }
  static std::uint32_t session_of(const Recorded& packet) {
    const auto header = wire::peek(packet.payload);
    return header ? header->session.value : 1;
  }
  Bytes hello(std::uint32_t session) {
    Bytes bytes(wire::kPacketOverhead);
    wire::write_probe(bytes,
                      {.type = wire::PacketType::kProbe,
                       .session = {session},
                       .number = 1 + (random_() & 0xFFFF)},
                      bytes.size());
    return bytes;
  }
  // The session that is used now, or another one; the number that comes next, or another one.
  Bytes guessed(const Recorded& newest) {
    Bytes bytes = draw(wire::kPacketOverhead + random_() % kSmall);
    const auto header = wire::peek(newest.payload);
    const std::uint64_t ahead = random_() % 3 == 0 ? random_() : 1 + random_() % 64;
    wire::write_header(bytes,
                       {.type = static_cast<wire::PacketType>(1 + random_() % 15),
                        .link = {static_cast<std::uint16_t>(random_() % 4)},
                        .epoch = wire::kSealedEpoch,
                        .session = {random_() % 4 == 0 ? static_cast<std::uint32_t>(random_()) | 1
                                                       : session_of(newest)},
                        .number = (header ? header->number : 0) + ahead});
    return bytes;
  }
  Bytes clear(const Recorded& newest) {
    const std::uint32_t session =
        random_() % 2 == 0 ? session_of(newest) : static_cast<std::uint32_t>(random_()) | 1;
    if (random_() % 2 == 0) return hello(session);
    wire::Feedback feedback;
    feedback.u = static_cast<std::int64_t>(random_() >> 1);
    feedback.echo = {static_cast<std::uint32_t>(random_())};
    feedback.reports.push_back({});
    Bytes bytes(wire::feedback_bytes(1));
    wire::write_feedback(bytes,
                         {.type = wire::PacketType::kFeedback,
                          .session = {session},
                          .number = std::max<std::uint64_t>(1, random_())},
                         feedback);
    return bytes;
  }

  const OutsiderOptions& o_;
  std::mt19937_64 random_;
  Initiations initiations_;
  std::uint32_t net_;
  std::array<Target, 2> targets_;
  std::vector<Recorded> old_;
  std::uint64_t turn_ = 0;
  double seconds_ = 0;
};

}  // namespace

int run_outsider(const OutsiderOptions& o) {
  Outsider outsider(o);
  if (!outsider.look_on()) return 1;
  outsider.run();
  outsider.tell();
  return 0;
}

}  // namespace interneuron::attacker
