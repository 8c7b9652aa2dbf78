#include "tests/netns/attacker/amplify.h"

#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <memory>
#include <optional>
#include <random>
#include <stdexcept>

#include "core/wire/bytes.h"
#include "core/wire/packet.h"
#include "interneuron/sizes.h"
#include "tests/netns/attacker/admitted_peer.h"
#include "tests/netns/attacker/spoof.h"

namespace interneuron::attacker {
namespace {

// The port of all victims; nothing listens there.
constexpr std::uint16_t kVictimPort = 41'000;
// What comes of all links beside the first in the addresses of victims.
constexpr std::uint32_t kAllLinks = 100;
// The attacker's own peer has this long to join and to be known.
constexpr double kJoinSeconds = 5;
constexpr double kKnownSeconds = 1;
constexpr double kOwnBitsPerSecond = 1e6;
// How far the numbers of what is forged are ahead of those of the attacker's own peer.
constexpr std::uint64_t kAhead = 1'000;

// Where a packet has its number.
constexpr std::size_t kNumberOffset = 8;

// How a victim's name is used.
enum class Way : std::uint8_t {
  // A hello and one forged echo, and never again.
  kOnce,
  // A forged echo with a report each second, so that the peer is kept.
  kSteady,
  // New sessions all the time, without an echo.
  kHellos,
  // The attacker's own session, which was admitted from its own address, goes on from the victim's.
  kMoved,
  // The same session, but the token that was given to the attacker's own address comes first.
  kToken,
  // Requests to measure, with held trains and delays.
  kEchoes,
};
constexpr std::array<const char*, 6> kWays{"once", "steady", "hellos", "moved", "token", "echoes"};

struct Link {
  SpoofSocket socket;
  Place road;
};

// One victim, and what was sent in its name.
class Forger {
 public:
  Forger(Way way, std::uint32_t victim, std::size_t links, std::uint64_t random)
      : way_(way), from_{victim, kVictimPort}, links_(links), random_(random) {
    session_ = fresh_session();
  }

  bool is_of_own_peer() const { return way_ == Way::kMoved || way_ == Way::kToken; }
  // From now on it seals what it sends.
  void seal_with(std::shared_ptr<SealedChannel> channel, const Keys& keys) {
    channel_ = std::move(channel);
    keys_ = keys;
  }
  // What was the attacker's own peer's goes on from the victim.
  void move(AdmittedPeer& own) {
    session_ = own.session().value;
    number_ = own.next_number() + kAhead;
    token_.assign(own.token().begin(), own.token().end());
  }
  void turn(double seconds, std::uint32_t echo, std::vector<Link>& links) {
    while (seconds >= next_) {
      for (std::size_t i = 0; i < links_; ++i) send(i, echo, links[i]);
      ++turns_;
      next_ += interval();
    }
  }
  void tell(bool last) const {
    const std::uint32_t h = from_.host;
    std::printf(
        "{\"victim\": \"%u.%u.%u.%u\", \"way\": \"%s\", \"links\": %zu, \"sent_packets\": "
        "%llu, \"sent_bytes\": %llu}%s",
        h >> 24, h >> 16 & 0xFF, h >> 8 & 0xFF, h & 0xFF, kWays[static_cast<std::size_t>(way_)],
        links_, static_cast<unsigned long long>(packets_), static_cast<unsigned long long>(bytes_),
        last ? "" : ", ");
  }

 private:
  std::uint32_t fresh_session() { return static_cast<std::uint32_t>(random_()) | 1; }
  double interval() const {
    if (way_ == Way::kOnce) return turns_ < 2 ? 0.2 : 1e9;
    if (way_ == Way::kHellos) return 0.1;
    if (way_ == Way::kEchoes) return 0.05;
    return is_of_own_peer() ? 0.5 : 1;
  }
  void send(std::size_t i, std::uint32_t echo, Link& link) {
    std::array<std::byte, kMaxDatagramBytes> out{};
    if (way_ == Way::kHellos) session_ = fresh_session();
    wire::PacketHeader header{.type = wire::PacketType::kProbe,
                              .link = {static_cast<std::uint16_t>(i)},
                              .session = {session_},
                              .number = ++number_};
    std::size_t size = 0;
    if (channel_ && way_ == Way::kHellos) {
      const Bytes initiation = SealedChannel(keys_, {session_}, random_).poll(now());
      std::ranges::copy(initiation, out.begin());
      return leave(link, ByteView(out).first(initiation.size()));
    }
    if (way_ == Way::kEchoes) {
      size = write_echo(header, out);
    } else if (way_ == Way::kToken && turns_ % 2 == 0 && !token_.empty()) {
      size = write_token(out);
    } else if (turns_ == 0 || way_ == Way::kHellos) {
      size = wire::write_probe(out, header, wire::kPacketOverhead);
    } else {
      size = write_forged(header, channel_ ? channel_->life() : echo, out);
    }
    if (channel_) channel_->seal(std::span(out).first(size));
    leave(link, ByteView(out).first(size));
  }
  void leave(Link& link, ByteView packet) {
    link.socket.add(from_, link.road, packet);
    ++packets_;
    bytes_ += packet.size() + kIpUdpBytes;
  }
  // Feedback that proves, if anything does, that the victim has heard the unit.
  std::size_t write_forged(wire::PacketHeader header, std::uint32_t echo,
                           std::span<std::byte> out) const {
    header.type = wire::PacketType::kFeedback;
    wire::Feedback feedback;
    feedback.u = static_cast<std::int64_t>(number_) * 1'000'000;
    feedback.echo = {echo};
    if (way_ != Way::kOnce) feedback.reports.push_back({.link = header.link});
    return wire::write_feedback(out, header, feedback);
  }
  std::size_t write_token(std::span<std::byte> out) const {
    std::ranges::copy(token_, out.begin());
    wire::Writer w(out.subspan(kNumberOffset));
    w.put(number_);
    return token_.size();
  }
  std::size_t write_echo(wire::PacketHeader header, std::span<std::byte> out) const {
    header.type = wire::PacketType::kEcho;
    wire::Echo echo;
    if (turns_ % 3 == 1) echo.delay = 1;
    if (turns_ % 3 == 2) {
      echo.hold = true;
      echo.train = static_cast<std::uint16_t>(turns_ | 1);
      echo.count = 2;
    }
    return wire::write_echo(out, header, echo, wire::kEchoBytes);
  }

  Way way_;
  Place from_;
  std::size_t links_;
  std::mt19937_64 random_;
  std::uint32_t session_ = 0;
  std::uint64_t number_ = 0;
  Bytes token_;
  std::shared_ptr<SealedChannel> channel_;
  Keys keys_;
  std::uint64_t turns_ = 0;
  double next_ = 0;
  std::uint64_t packets_ = 0;
  std::uint64_t bytes_ = 0;
};

// Joins from the attacker's own address. False where it is not admitted.
bool join(AdmittedPeer& peer, int socket) {
  const TimePoint began = now();
  std::optional<TimePoint> joined;
  while (!joined || seconds_between(*joined, now()) < kKnownSeconds) {
    pollfd item{socket, POLLIN, 0};
    ::poll(&item, 1, 5);
    peer.turn(now());
    if (!joined && peer.joined()) joined = now();
    if (!joined && seconds_between(began, now()) > kJoinSeconds) return false;
  }
  return true;
}

// Makes a handshake from the attacker's own address and shows no token. Nothing where it is not
// answered.
std::shared_ptr<SealedChannel> shake(const Keys& keys, int socket, std::mt19937_64& random) {
  const auto channel = std::make_shared<SealedChannel>(
      keys, SessionId{static_cast<std::uint32_t>(random()) | 1}, random);
  const TimePoint began = now();
  while (!channel->is_open()) {
    if (seconds_between(began, now()) > kJoinSeconds) return nullptr;
    const Bytes initiation = channel->poll(now());
    if (!initiation.empty()) ::send(socket, initiation.data(), initiation.size(), MSG_DONTWAIT);
    pollfd item{socket, POLLIN, 0};
    ::poll(&item, 1, 5);
    std::array<std::byte, kMaxDatagramBytes> buffer;
    const ssize_t n = ::recv(socket, buffer.data(), buffer.size(), MSG_DONTWAIT);
    if (n > 0) channel->take(now(), ByteView(buffer).first(static_cast<std::size_t>(n)));
  }
  return channel;
}

// What this victim's name is used with, first of all. False where the unit does not admit it.
bool begin(const AmplifyOptions& o, const Link& link, std::size_t place, Forger& forger,
           std::uint32_t& echo, std::mt19937_64& random) {
  std::optional<Keys> keys;
  if (!o.keys.empty()) keys = {read_key(o.keys.at(place)), read_public_key(o.road_key)};
  if (!forger.is_of_own_peer() && !keys) return true;
  const io::FileDescriptor socket = open_udp(o.nics[0], {}, &link.road);
  if (!forger.is_of_own_peer()) {
    const auto channel = shake(*keys, socket.get(), random);
    forger.seal_with(channel, *keys);
    return channel != nullptr;
  }
  AdmittedPeer own(socket.get(), kOwnBitsPerSecond, now(), random, keys ? &*keys : nullptr);
  if (!join(own, socket.get())) return false;
  echo = own.echo();
  forger.move(own);
  if (keys) forger.seal_with(own.channel(), *keys);
  return true;
}

std::vector<Link> open_links(const AmplifyOptions& o) {
  if (o.nics.empty() || o.nics.size() != o.roads.size()) {
    throw std::runtime_error("give as many --road as --nic, one of each at least");
  }
  std::vector<Link> links;
  for (std::size_t i = 0; i < o.nics.size(); ++i) {
    require_confined(o.nics[i]);
    links.push_back({SpoofSocket(o.nics[i]), parse_place(o.roads[i])});
  }
  return links;
}

}  // namespace

int run_amplify(const AmplifyOptions& o) {
  std::vector<Link> links = open_links(o);
  std::mt19937_64 random(o.seed);
  const std::uint32_t net = parse_host(o.victims);
  // One more peer of the attacker's own for each victim that it moves to.
  std::vector<Forger> forgers;
  std::uint32_t echo = 0;
  for (const std::size_t used : {std::size_t{1}, links.size()}) {
    for (std::uint32_t i = 0; i < kWays.size(); ++i) {
      const std::uint32_t victim = net + 1 + i + (forgers.size() >= kWays.size() ? kAllLinks : 0);
      Forger forger(static_cast<Way>(i), victim, used, random());
      if (!begin(o, links[0], forgers.size(), forger, echo, random)) return 1;
      forgers.push_back(std::move(forger));
    }
  }
  const TimePoint began = now();
  while (seconds_between(began, now()) < o.seconds) {
    for (Forger& forger : forgers) forger.turn(seconds_between(began, now()), echo, links);
    for (Link& link : links) link.socket.flush();
    ::poll(nullptr, 0, 5);
  }
  std::printf("{\"seconds\": %.3f, \"victims\": [", seconds_between(began, now()));
  for (const Forger& forger : forgers) forger.tell(&forger == &forgers.back());
  std::printf("]}\n");
  return 0;
}

int run_stamp(const StampOptions& o) {
  require_confined(o.nic);
  SpoofSocket socket(o.nic);
  std::array<std::byte, wire::kStampBytes> out;
  wire::write_stamp_request(out, {}, out.size());
  socket.add(o.from, o.to, out);
  socket.flush();
  return socket.packets() == 1 ? 0 : 1;
}

}  // namespace interneuron::attacker
