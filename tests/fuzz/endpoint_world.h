// One Endpoint under any sequence of inputs, and what must hold whatever they are: its loop never
// spins, an address that has not proved to be there gets at most three times the IP bytes that came
// from it, memory stays within its bounds, every accepted message has one fate and every round one
// answer. Ends the program with a line where one of these does not hold (finding.h).
//
// Virtual time alone. Beside the endpoint stands an honest partner, a second Endpoint whose packets
// wait until a step of the program delivers them: it brings the first one into states that no
// guessed packet reaches. All other hosts are names for addresses; where packets are encrypted they
// have keys besides, and what leaves the endpoint must be sealed, no number twice under one key.
// Single-threaded; owns both endpoints; memory is bounded by what a program does in its steps.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <set>
#include <vector>

#include "interneuron/endpoint.h"
#include "tests/fuzz/endpoint_keys.h"

namespace interneuron::fuzz {

// Hosts that packets may claim to be from. The last is the honest partner; the last but two are
// reached over IPv6, all others over IPv4.
inline constexpr std::size_t kHosts = 8;
inline constexpr std::size_t kPartner = kHosts - 1;
// Has a key that nobody trusts, where packets are encrypted.
inline constexpr std::size_t kStranger = 0;
inline constexpr std::size_t kLinks = 4;

inline constexpr SessionId kOwnSession{0x5eed0001};
inline constexpr SessionId kPartnerSession{0xcafe0002};

// The address of a host on a link; different for each.
Address address_of(std::size_t host, std::size_t link);

class World {
 public:
  // Which side the endpoint is: a roadside unit that serves whoever comes, or a vehicle that
  // connects to its partner.
  enum class Side : std::uint8_t { kRoad, kVehicle };
  enum class Protection : std::uint8_t { kClear, kSealed };
  World(Side side, Protection protection);

  Endpoint& endpoint() { return endpoint_; }
  TimePoint now() const { return now_; }
  bool has_link(std::size_t link) const { return links_.contains(link); }

  // --- what happens to the endpoint, which is then drained
  void feed(std::size_t host, std::size_t link, ByteView bytes, std::uint8_t ecn = 0);
  // This packet as the host would send it over this link: where packets are encrypted it makes a
  // handshake first, unless its keys are good, and seals the packet.
  Bytes as_sent(std::size_t host, std::size_t link, Bytes plain);
  // Time goes on by `by` as a loop would let it, or at once, as after a pause of the process.
  void pass(Duration by);
  void jump(Duration by);
  void add_link(std::size_t link, const LinkInfo& info);
  void remove_link(std::size_t link);
  void connect(std::size_t host, std::span<const std::size_t> links);
  void add_path(PeerId peer, std::size_t host, std::size_t link);
  void send(PeerId peer, Variants variants, const SendOptions& options);
  void begin_round(PipelineId pipeline, Variants variants);
  void local_result(std::size_t round, std::size_t bytes);
  void cancel(std::size_t message);
  // What is due is done, after which the endpoint must have come to rest.
  void settle();
  // So much time goes by that every message has its fate and every round its answer.
  void finish();

  // --- the partner
  enum class Fate : std::uint8_t { kDelivered, kTwice, kDamaged, kLost };
  // The next packet that is under way between the two, if there is one.
  void deliver(Fate fate, std::uint8_t damage);
  void partner_sends(std::size_t bytes);

  // --- what somebody learns who sees the endpoint's packets
  // What it sent last to an address; nothing: nothing yet.
  struct Seen {
    std::uint64_t in_bytes = 0;
    std::uint64_t out_bytes = 0;
    // The endpoint was told its own session, as an answer to a packet of it, from this address.
    bool echoed = false;
    // The token of a challenge came back from this address.
    bool answered = false;
    // The endpoint was told by the application to talk to this address.
    bool named = false;
    // The newest token that it was sent; and all of them, since an older one is good for a while.
    std::optional<std::array<std::byte, 16>> token{};
    std::set<std::array<std::byte, 16>> tokens{};
    std::uint64_t last_number = 0;
    Bytes last{};
  };
  const Seen& seen(std::size_t host, std::size_t link) { return seen_[address_of(host, link).raw]; }

  // What memory, counters and estimates must be at any time.
  void check() const;

 private:
  struct Flight {
    bool to_partner = false;
    std::uint16_t link = 0;
    Bytes bytes;
    std::uint8_t ecn = 0;
  };

  void drain();
  bool drain_events();
  std::size_t drain_packets();
  void take(const Event& event);
  void take(const Transmit& transmit, ByteView bytes);
  void note_proof(Seen& from, ByteView bytes) const;
  // The same where packets are encrypted.
  void note_sealed_proof(std::size_t host, Seen& from, ByteView bytes) const;
  void note_sealed(const Transmit& transmit, Seen& to, ByteView bytes);
  void note_challenge(Seen& to, ByteView bytes);
  void drain_partner();
  void drain_answers();
  void launch(Flight flight);
  std::int64_t heap_growth() const;

  Side side_;
  TimePoint now_;
  // Where packets are encrypted.
  std::optional<Keys> keys_;
  Endpoint endpoint_;
  Endpoint partner_;
  std::set<std::size_t> links_;
  // The hosts that it has connected to.
  std::set<std::size_t> connected_;
  std::map<std::array<std::byte, 28>, Seen> seen_;
  // The endpoint has challenged somebody: from then on an echoed session proves nothing.
  bool challenges_ = false;
  std::deque<Flight> flights_;
  // What is in the packets that hosts have sealed; handshakes that wait to be answered; and what
  // has left under which key, on which path, with which number.
  std::map<Bytes, Bytes> inside_;
  struct Answer {
    std::size_t host = 0;
    std::size_t link = 0;
    Bytes bytes;
  };
  std::deque<Answer> answers_;
  std::set<std::tuple<std::uint32_t, std::uint32_t, std::uint64_t>> numbers_;
  std::size_t handshakes_left_;
  std::vector<SendId> messages_;
  std::set<std::uint64_t> without_fate_;
  std::vector<RoundRef> rounds_;
  std::set<RoundRef> without_answer_;
  std::size_t wakes_left_;
  std::size_t partner_wakes_left_;
  std::size_t heap_before_ = 0;
};

}  // namespace interneuron::fuzz
