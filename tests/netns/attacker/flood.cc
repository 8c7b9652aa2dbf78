#include "tests/netns/attacker/flood.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <optional>
#include <random>

#include "core/wire/bytes.h"
#include "interneuron/sizes.h"
#include "tests/netns/attacker/admitted_peer.h"
#include "tests/netns/attacker/initiations.h"
#include "tests/netns/attacker/sealed_channel.h"
#include "tests/netns/attacker/spoof.h"

namespace interneuron::attacker {
namespace {

// What a generator that was kept waiting makes good at once.
constexpr double kMostBehindSeconds = 0.05;
// The port of all owned addresses.
constexpr std::uint16_t kOwnedPort = 40'000;

// A first packet as an Endpoint sends it: a probe or feedback of a session never seen before; or an
// initiation.
class Hellos {
 public:
  Hellos(std::uint64_t seed, const std::string& road_key) : random_(seed) {
    if (!road_key.empty()) initiations_.emplace(read_public_key(road_key), random_);
  }

  std::uint64_t random() { return random_(); }
  // Nothing: in the clear.
  Initiations* initiations() { return initiations_ ? &*initiations_ : nullptr; }
  // From where no answer is received.
  ByteView next_spoofed() {
    if (initiations_ && random_() % 2 == 0) return initiations_->random();
    return next();
  }
  ByteView next() {
    if (initiations_) return initiations_->whole();
    const std::uint64_t drawn = random_();
    wire::PacketHeader header{.type = wire::PacketType::kProbe,
                              .link = {static_cast<std::uint16_t>(drawn & 3)},
                              .session = {static_cast<std::uint32_t>(drawn >> 32) | 1},
                              .number = 1 + (drawn >> 2 & 0xFFFF),
                              .stamp_us = static_cast<std::uint32_t>(drawn >> 8)};
    if ((drawn & 4) != 0) {
      wire::write_probe(buffer_, header, wire::kPacketOverhead);
      return ByteView(buffer_).first(wire::kPacketOverhead);
    }
    header.type = wire::PacketType::kFeedback;
    wire::Feedback feedback;
    feedback.u = static_cast<std::int64_t>(drawn >> 1);
    feedback.reports.push_back({.link = header.link});
    return ByteView(buffer_).first(wire::write_feedback(buffer_, header, feedback));
  }

 private:
  std::mt19937_64 random_;
  std::optional<Initiations> initiations_;
  std::array<std::byte, kMaxDatagramBytes> buffer_{};
};

// How many packets of a rate are due.
class Pace {
 public:
  explicit Pace(double per_second) : per_second_(per_second) {}
  std::size_t due(double elapsed) {
    done_ = std::max(done_, (elapsed - kMostBehindSeconds) * per_second_);
    const double due = std::floor(elapsed * per_second_ - done_);
    if (due < 1) return 0;
    done_ += due;
    return static_cast<std::size_t>(due);
  }

 private:
  double per_second_;
  double done_ = 0;
};

// The addresses that are the attacker's, behind one socket that chooses the source of each packet.
class Owned {
 public:
  Owned(const FloodOptions& o, Initiations* initiations)
      : socket_(open_udp(o.nic, {0, kOwnedPort}, nullptr)),
        initiations_(initiations),
        road_(o.road),
        net_(parse_host(o.owned) & 0xFFFF0000U) {
    const int on = 1;
    if (::setsockopt(socket_.get(), IPPROTO_IP, IP_PKTINFO, &on, sizeof on) != 0) {
      fail_call("IP_PKTINFO");
    }
  }
  // Each hello allows one answer to feedback, so that two answers never chase each other.
  void send_hello(Hellos& hellos) {
    ++allowed_echoes_;
    send(net_ | static_cast<std::uint32_t>(hellos.random() & 0xFFFF), hellos.next());
    ++hellos_;
  }
  // Answers cookies, challenges by tokens, and feedback by feedback that proves that it has come.
  void answer(TimePoint now) {
    std::array<std::byte, kMaxDatagramBytes> buffer;
    std::array<std::byte, CMSG_SPACE(sizeof(in_pktinfo))> control;
    for (;;) {
      iovec part{buffer.data(), buffer.size()};
      msghdr message{};
      message.msg_iov = &part;
      message.msg_iovlen = 1;
      message.msg_control = control.data();
      message.msg_controllen = control.size();
      const ssize_t n = ::recvmsg(socket_.get(), &message, MSG_DONTWAIT);
      if (n < 0) return;
      const cmsghdr* c = CMSG_FIRSTHDR(&message);
      if (c == nullptr || c->cmsg_type != IP_PKTINFO) continue;
      in_pktinfo info;
      std::memcpy(&info, CMSG_DATA(c), sizeof info);
      take(now, ntohl(info.ipi_addr.s_addr), ByteView(buffer).first(static_cast<std::size_t>(n)));
    }
  }
  int handle() const { return socket_.get(); }
  std::uint64_t hellos() const { return hellos_; }
  std::uint64_t tokens() const { return tokens_; }
  std::uint64_t echoes() const { return echoes_; }
  // What else came while it asked for handshakes.
  std::uint64_t others() const { return others_; }

 private:
  void take(TimePoint now, std::uint32_t at, ByteView packet) {
    if (initiations_ != nullptr) {
      const ByteView answer = initiations_->with_cookie(packet);
      ++(answer.empty() ? others_ : tokens_);
      if (!answer.empty()) send(at, answer);
      return;
    }
    std::array<std::byte, kMaxDatagramBytes> out;
    std::uint32_t self = challenged(packet);
    if (self != 0) {
      const std::size_t size = answer_challenge(packet, {self}, kTokenNumber, out);
      send(at, ByteView(out).first(size));
      ++tokens_;
    } else {
      const auto parsed = wire::parse(packet);
      if (!parsed || parsed->header.type != wire::PacketType::kFeedback) return;
      if (allowed_echoes_ == 0) return;
      --allowed_echoes_;
      self = parsed->feedback.echo.value;
      ++echoes_;
    }
    if (self == 0) return;
    wire::Reader link(packet.subspan(2));
    send(at, hello({.type = wire::PacketType::kFeedback,
                    .link = {link.get<std::uint16_t>()},
                    .session = {self},
                    .number = ++answer_number_},
                   now.time_since_epoch().count(), sender_of(packet)));
  }
  void send(std::uint32_t from, ByteView packet) {
    std::array<std::byte, CMSG_SPACE(sizeof(in_pktinfo))> control{};
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_port = htons(road_.port);
    to.sin_addr.s_addr = htonl(road_.host);
    iovec part{const_cast<std::byte*>(packet.data()), packet.size()};
    msghdr message{};
    message.msg_name = &to;
    message.msg_namelen = sizeof to;
    message.msg_iov = &part;
    message.msg_iovlen = 1;
    message.msg_control = control.data();
    message.msg_controllen = control.size();
    cmsghdr* c = CMSG_FIRSTHDR(&message);
    c->cmsg_level = IPPROTO_IP;
    c->cmsg_type = IP_PKTINFO;
    c->cmsg_len = CMSG_LEN(sizeof(in_pktinfo));
    in_pktinfo info{};
    info.ipi_spec_dst.s_addr = htonl(from);
    std::memcpy(CMSG_DATA(c), &info, sizeof info);
    if (::sendmsg(socket_.get(), &message, MSG_DONTWAIT) < 0 && errno != EAGAIN &&
        errno != ENOBUFS) {
      fail_call("sendmsg from the owned network");
    }
  }

  // Larger than the number of any hello, which is below 2^16 + 2.
  static constexpr std::uint64_t kTokenNumber = 100'000;
  io::FileDescriptor socket_;
  Initiations* initiations_;
  Place road_;
  std::uint32_t net_;
  std::uint64_t answer_number_ = kTokenNumber;
  std::uint64_t hellos_ = 0;
  std::uint64_t tokens_ = 0;
  std::uint64_t echoes_ = 0;
  std::uint64_t others_ = 0;
  std::uint64_t allowed_echoes_ = 0;
};

}  // namespace

int run_flood(const FloodOptions& o) {
  require_confined(o.nic);
  SpoofSocket spoofed(o.nic);
  Hellos hellos(o.seed, o.road_key);
  Owned owned(o, hellos.initiations());
  Pace spoofed_pace(o.spoofed_pps);
  Pace owned_pace(o.owned_pps);
  const std::uint32_t net = parse_host(o.spoofed) & 0xFFFF0000U;
  const TimePoint began = now();
  for (;;) {
    const TimePoint at = now();
    const double elapsed = seconds_between(began, at);
    if (elapsed >= o.seconds) break;
    for (std::size_t i = spoofed_pace.due(elapsed); i > 0; --i) {
      const std::uint64_t drawn = hellos.random();
      const Place from{net | static_cast<std::uint32_t>(drawn & 0xFFFF),
                       static_cast<std::uint16_t>(1024 + (drawn >> 16) % 60'000)};
      spoofed.add(from, o.road, hellos.next_spoofed());
    }
    spoofed.flush();
    for (std::size_t i = owned_pace.due(elapsed); i > 0; --i) owned.send_hello(hellos);
    owned.answer(at);
    pollfd item{owned.handle(), POLLIN, 0};
    ::poll(&item, 1, 1);
  }
  const double took = seconds_between(began, now());
  std::printf(
      "{\"seconds\": %.3f, \"spoofed_pps\": %.0f, \"owned_pps\": %.0f, \"tokens\": %llu, "
      "\"echoes\": %llu, \"others\": %llu}\n",
      took, static_cast<double>(spoofed.packets()) / took,
      static_cast<double>(owned.hellos()) / took, static_cast<unsigned long long>(owned.tokens()),
      static_cast<unsigned long long>(owned.echoes()),
      static_cast<unsigned long long>(owned.others()));
  return 0;
}

}  // namespace interneuron::attacker
