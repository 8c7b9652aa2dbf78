// What answers measuring packets: EchoReflector those of our own format, StampReflector those of
// STAMP.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "core/base/source_limit.h"
#include "core/wire/packet.h"
#include "core/wire/stamp.h"
#include "interneuron/endpoint.h"

namespace interneuron::probe {

// How many measuring packets one source is answered:
// 2,000 answers a second: twice what the shortest interval of `interneuron probe`, 1 ms, asks for,
// so that two hosts behind one address fit.
inline constexpr Duration kAnswerInterval = std::chrono::microseconds(500);
// Answers at once after a pause: the 8 trains of 256 packets with which `interneuron probe`
// measures a rate.
inline constexpr int kAnswerBurst = 8 * 256;

// Answers the echo requests of `interneuron probe` (docs/wire_format.md): a stateful
// Session-Reflector of RFC 8762 §4.3 inside our own packets.
//
// Each request gets one reply of the same size, over the NIC and to the address that it came from:
// at once, after the delay that it asks for or, in a held train, back to back with the train's
// other replies. Peers feeds it the echoes of every sender, known or not, and polls the replies.
//
// In the clear requests are not authenticated, so anybody may send them from a forged address;
// where packets are encrypted, only hosts that are trusted can ask. An attacker gains no
// amplification, because a reply is as large as its request and there is one per request. No source
// gets more than SourceLimit lets it have. Neither replies nor what comes from the port of STAMP
// (862) is answered, so that no two reflectors answer each other. Replies are held or delayed only
// for addresses that are proved, so that nobody saves up replies for another one. He learns this
// host's monotonic clock and how many of his requests arrived. Asking makes nobody a peer and costs
// memory only up to the bounds below; a flood of senders pushes out the counts of the paths that
// were silent for longest, and a flood of requests takes the place of others'.
//
// Pure; thread-compatible; never throws.
class EchoReflector {
 public:
  // Paths whose requests are counted: room for 8 vehicles with 8 NICs each. A further one replaces
  // the path that was silent for longest, whose numbers begin at 0 when it asks again.
  static constexpr std::size_t kMaxPaths = 64;
  // Trains that wait at the same time for their last request; requests of further trains are
  // answered at once, which spoils only their rate of the way back. One per vehicle of kMaxPaths.
  static constexpr std::size_t kMaxHeldTrains = 8;
  // The same for one host, which measures one path after the other over each NIC.
  static constexpr std::size_t kMaxHeldTrainsOfHost = 2;
  // Replies that wait, in held trains or for the next poll(); further requests are dropped. Room
  // for four of the longest trains.
  static constexpr std::size_t kMaxWaiting = 4 * wire::kMaxEchoTrain;
  // Replies that wait for the delay that they were asked for, beside those above, in all and for
  // one host; further ones are sent at once. Room for the 8 silences with 2 flows each of one NIC
  // of `interneuron doctor`, and for four of those.
  static constexpr std::size_t kMaxDelayed = 64;
  static constexpr std::size_t kMaxDelayedOfHost = 16;
  // A held train whose last request was lost leaves this long after its newest request. At 1 Mbit/s
  // requests come 11 ms apart, so this outlives a burst of eight lost ones.
  static constexpr Duration kHold = std::chrono::milliseconds(100);
  // A held train leaves at the latest this long after its first request, so that a sender who
  // trickles requests cannot keep the memory.
  static constexpr Duration kHoldAtMost = std::chrono::milliseconds(500);

  explicit EchoReflector(SessionId self) : self_(self) {}

  struct Asker {
    // The request's token proves its address.
    bool is_proved = false;
    // What its next request is to bring.
    wire::Token token{};
  };
  // Queues the reply to `packet`, an echo that came in as `datagram`. False when it is not
  // answered: it is a reply, it carries our own session (our packet came back), it comes from the
  // port of STAMP, its source has had all answers that it may have, or there is no room.
  bool take(TimePoint now, const wire::Packet& packet, const Datagram& datagram,
            const Asker& asker);
  // Forgets the paths of this NIC and the replies that would leave over it.
  void remove_link(LinkId nic);

  // When poll() has something new to give although no request comes; nothing: never.
  std::optional<TimePoint> next_timeout() const;
  // To whom: the session of the request.
  struct Leaving : Transmit {
    SessionId session{};
  };
  // Writes the next reply that is due into `buffer`, which must hold kMaxDatagramBytes.
  std::optional<Leaving> poll(TimePoint now, std::span<std::byte> buffer);
  // Replies that have not left yet, of every kind.
  std::size_t waiting() const;

 private:
  struct Reply {
    LinkId nic{};
    Address to{};
    SessionId session{};
    // The path's name in the request, which the reply repeats.
    LinkId link{};
    wire::Echo echo;
    std::size_t size = 0;
  };
  struct Path {
    LinkId nic{};
    Address from{};
    SessionId session{};
    LinkId link{};
    // Requests that have arrived, dropped ones included; numbers the replies.
    std::uint32_t requests = 0;
    TimePoint heard{};
    // The number of the train that is held; its replies, in the order of arrival, are `held`.
    std::uint16_t train = 0;
    TimePoint train_began{};
    std::vector<Reply> held;
  };
  Path& path_of(TimePoint now, const wire::PacketHeader& header, const Datagram& datagram);
  bool may_hold(const Path& path) const;
  bool may_delay(const Address& to) const;
  void release(Path& path);
  void release_due(TimePoint now);
  static TimePoint release_at(const Path& path);

  SessionId self_;
  SourceLimit limit_{probe::kAnswerInterval, probe::kAnswerBurst};
  std::vector<Path> paths_;
  // By the instant at which they leave.
  std::multimap<TimePoint, Reply> delayed_;
  std::deque<Reply> ready_;
};

// A Session-Reflector of RFC 8762 §4.3, unauthenticated mode, for `interneuron road --stamp`: one
// answer of the same size for each test packet that the caller hands to it, so that any STAMP
// sender can measure a path to this host.
//
// Stateful unless asked otherwise: the answers of a session are numbered from 0, and a session is
// whoever asks from one address at one NIC. An attacker with many forged addresses can push out the
// sessions of others, whose numbers then begin anew; he gains no amplification, and memory stays
// within kMaxSessions records. He can have this host send to an address that he forges, as many
// packets as he sends himself and no more than SourceLimit lets each source have.
//
// Two reflectors must never answer each other, because a packet forged in the name of one would
// keep both busy for ever, and a reply has the form of a request. So nothing is answered that comes
// from the port of a reflector (862, or our own) or that has all marks of a reply, whether of STAMP
// or of EchoReflector. Senders that pad their requests with zeros or random bytes are answered: the
// marks are 40 bits that padding would have to hit.
// Pure; thread-compatible; never throws.
class StampReflector {
 public:
  // Sessions that are numbered at once; a further one replaces the session that was silent for
  // longest. No measurement behind this value: it only has to be larger than the number of senders
  // that measure at the same time. 1,024 records take about 50 KB.
  static constexpr std::size_t kMaxSessions = 1024;
  // A session that was silent for so long is over: the next packet begins a new one. REFWAIT of
  // RFC 5357 §3.1, which STAMP's ancestor has for it: 900 s.
  static constexpr Duration kSessionSilence = std::chrono::seconds(900);

  // `port` is the one that requests come to.
  explicit StampReflector(bool stateful, std::uint16_t port = wire::kStampPort)
      : stateful_(stateful), port_(port) {}

  struct Request {
    LinkId nic{};
    Address from{};
    ByteView bytes;
    std::uint8_t ttl = 0;
    TimePoint received{};
  };
  // Writes the answer into `out` and returns its size in bytes; 0: the request is no test packet,
  // its sender may be a reflector or has had all answers that it may have, or the answer does not
  // fit. `sent` is the instant at which the answer will leave. `wall` is
  // added to both instants and turns this host's monotonic clock into the time since 1900 that the
  // wire carries.
  std::size_t answer(const Request& request, TimePoint sent, Duration wall,
                     std::span<std::byte> out);

 private:
  struct Session {
    LinkId nic{};
    Address from{};
    std::uint32_t answers = 0;
    TimePoint heard{};
  };
  bool from_reflector(const Request& request) const;
  Session& session_of(const Request& request);

  bool stateful_;
  std::uint16_t port_;
  SourceLimit limit_{kAnswerInterval, kAnswerBurst};
  std::vector<Session> sessions_;
};

}  // namespace interneuron::probe
