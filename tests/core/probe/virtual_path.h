// A path in virtual time between a probe::Measurement and a reflector: delay, rate, loss,
// duplicates and overtaking each way, a clock at the far end that is off and drifts. It knows what
// really happened.
#pragma once

#include <array>
#include <functional>
#include <optional>
#include <random>

#include "core/probe/measurement.h"
#include "core/probe/reflectors.h"
#include "tests/virtual_network.h"

namespace interneuron::probe {

using namespace std::chrono_literals;

struct Way {
  Duration delay = 10ms;
  DataRate rate{};  // 0: unlimited
  double loss = 0;
  double duplicates = 0;
  double overtaken = 0;  // comes `later` later
  Duration later = 50ms;
  // On top: true = this packet (the n-th on this way) is lost.
  std::function<bool(std::size_t n)> lose{};
};

enum class Reflector { kStateful, kStateless };

class VirtualPath {
 public:
  VirtualPath(const Options& options, const Way& there, const Way& back, std::uint64_t seed = 1,
              Reflector reflector = Reflector::kStateful)
      : up{there},
        down{back},
        session(options, TimePoint{1s}),
        options_(options),
        random_(seed),
        reflector_(reflector) {}

  // To the end, or for so long.
  void run(Duration at_most = 24h) {
    const TimePoint end = now() + at_most;
    drain();
    while (!session.done()) {
      std::optional<TimePoint> next = session.next_timeout();
      const auto consider = [&next](TimePoint t) {
        if (!next || t < *next) next = t;
      };
      if (const auto t = network_.next()) consider(*t);
      if (const auto t = echo_.next_timeout()) consider(to_own(*t));
      if (!next || *next > end) break;
      network_.move_to(*next);
      if (on_step) on_step(*this);
      deliver();
      drain();
    }
  }

  struct Truth {
    std::size_t lost_up = 0;  // pings
    std::size_t lost_down = 0;
  };
  Way up;
  Way down;
  Truth truth;
  Measurement session;
  std::vector<Reply> replies;
  double drift = 0;       // of the far clock, seconds per second
  Duration offset = 77s;  // of the far clock
  Duration turnaround{};  // of the reflector
  std::function<void(VirtualPath&)> on_step;
  TimePoint now() const { return network_.now(); }

 private:
  struct InFlight {
    Bytes bytes;
    bool is_up = false;
    bool is_ping = false;
  };
  struct Queue {
    TimePoint free{};
    std::size_t packets = 0;
  };

  TimePoint to_far(TimePoint t) const {
    return TimePoint{t.time_since_epoch() + offset +
                     Duration{static_cast<std::int64_t>(
                         drift * static_cast<double>(t.time_since_epoch().count()))}};
  }
  TimePoint to_own(TimePoint far) const {
    const auto ns = static_cast<double>((far.time_since_epoch() - offset).count()) / (1 + drift);
    return TimePoint{Duration{static_cast<std::int64_t>(ns) + 1}};
  }
  bool chance(double p) { return std::uniform_real_distribution<>(0, 1)(random_) < p; }

  void carry(InFlight packet) {
    Way& way = packet.is_up ? up : down;
    Queue& queue = packet.is_up ? up_queue_ : down_queue_;
    const std::size_t number = queue.packets++;
    // As on a radio: what is lost has used the bottleneck.
    queue.free = std::max(queue.free, now());
    if (way.rate.bits_per_second > 0) {
      queue.free += way.rate.transmit_time(packet.bytes.size() + options_.ip_udp_bytes);
    }
    if (chance(way.loss) || (way.lose && way.lose(number))) {
      if (packet.is_ping) ++(packet.is_up ? truth.lost_up : truth.lost_down);
      return;
    }
    TimePoint arrives = queue.free + way.delay;
    if (chance(way.overtaken)) arrives += way.later;
    if (chance(way.duplicates)) network_.send(arrives + 1us, packet);
    network_.send(arrives, std::move(packet));
  }

  void deliver() {
    network_.run([this](const InFlight& packet) {
      if (packet.is_up) {
        reflect(packet);
      } else if (auto reply = session.handle(now(), packet.bytes)) {
        replies.push_back(*reply);
      }
    });
  }

  void reflect(const InFlight& packet) {
    if (options_.format == Format::kEcho) {
      const auto parsed = wire::parse(packet.bytes);
      echo_.take(to_far(now()), *parsed, {LinkId{0}, {}, packet.bytes}, {true, {}});
      return;
    }
    const auto request = wire::parse_stamp_request(packet.bytes);
    wire::StampReply reply = wire::stamp_reply_to(*request, 64);
    if (reflector_ == Reflector::kStateful) reply.sequence = counted_++;
    reply.received = wire::to_stamp_time(to_far(now()).time_since_epoch());
    reply.sent = wire::to_stamp_time((to_far(now()) + turnaround).time_since_epoch());
    Bytes out(packet.bytes.size());
    wire::write_stamp_reply(out, reply, ByteView(packet.bytes).subspan(wire::kStampBytes));
    carry({out, false, packet.is_ping});
  }

  void drain() {
    std::array<std::byte, 2000> buffer;
    while (const std::size_t size = session.poll(now(), buffer)) {
      const bool is_ping = session.log().back().purpose == Purpose::kPing;
      carry({Bytes(buffer.begin(), buffer.begin() + static_cast<std::ptrdiff_t>(size)), true,
             is_ping});
    }
    while (const auto transmit = echo_.poll(to_far(now()), buffer)) {
      const ByteView bytes = ByteView(buffer).first(transmit->size);
      const auto sequence = wire::parse(bytes)->echo.reply.request_sequence;
      const bool is_ping = session.log().at(sequence).purpose == Purpose::kPing;
      carry({Bytes(bytes.begin(), bytes.end()), false, is_ping});
    }
  }

  Options options_;
  std::mt19937_64 random_;
  Reflector reflector_;
  EchoReflector echo_{SessionId{0xcafe0002}};
  std::uint32_t counted_ = 0;
  VirtualNetwork<InFlight> network_;
  Queue up_queue_;
  Queue down_queue_;
};

inline Options options_of(Format format = Format::kEcho, std::size_t count = 200,
                          bool rate = false) {
  return Options{.format = format,
                 .count = count,
                 .rate = rate,
                 .session = SessionId{0x5eed0001},
                 .link = LinkId{3},
                 .wall = 1000h};
}

}  // namespace interneuron::probe
