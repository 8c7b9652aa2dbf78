// A session between two hosts, and the window that keeps replays out of it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "core/secure/aead.h"
#include "core/secure/noise.h"
#include "core/wire/packet.h"
#include "interneuron/time.h"

namespace interneuron::crypto {

// Which numbers of packets have come under one key: each is taken once. A bitmap in the manner of
// RFC 6479: numbers fall into words of 64 bits that follow each other in a ring, and the whole word
// that becomes the newest one is cleared, so that nothing is shifted.
//
// Links of a vehicle differ by up to a second, but each has a window of its own: only what one link
// reorders has to fit. 8,128 numbers are 0.8 s at 10,000 packets a second. Ask before a packet is
// opened and take its number after: a number that was never proved must not move the window.
// 1 KB. Pure; thread-compatible.
class ReplayWindow {
 public:
  static constexpr std::size_t kBits = 8192;
  static constexpr std::size_t kWordBits = 64;
  // How far behind the largest number one may be.
  static constexpr std::uint64_t kReach = kBits - kWordBits;

  // Whether this number has neither come nor is too old to tell.
  bool is_new(std::uint64_t number) const;
  // It has come, in a packet that was authentic and whose number is new.
  void take(std::uint64_t number);
  std::uint64_t largest() const { return largest_; }

 private:
  static constexpr std::size_t kWords = kBits / kWordBits;

  // No number has come yet: even 0 may.
  bool is_empty_ = true;
  std::uint64_t largest_ = 0;
  std::array<std::uint64_t, kWords> words_{};
};

inline constexpr Duration kRekeyAfter = std::chrono::seconds(120);
inline constexpr Duration kRejectAfter = std::chrono::seconds(180);

// What two hosts have agreed on in one handshake: it seals packets of one and opens those of the
// other. Sessions has up to four for each peer: the newest, the one before it, and those that the
// other side may begin to use.
//
// Every path has a key of its own in each direction, derived when it is first used, and so have the
// packets that belong to no path's numbers (challenges and echoes). So a packet of one path is none
// on any other, whatever numbers both use.
//
// What is kept, whatever whoever asks does: no number of a path is sealed twice, because each has
// to be larger than all before; no number is opened twice (ReplayWindow). A path that is taken away
// keeps its keys and numbers here until the session ends, so that one that comes back under the
// same name does not begin anew. That takes memory for every name, so there are at most kMaxPaths
// in each direction: wants_rekey() says when a new session should be agreed on before there is no
// room. A key is used for kRekeyAfter, and not at all after kRejectAfter, which are WireGuard's
// times ("WireGuard: Next Generation Kernel Network Tunnel", Donenfeld).
//
// Of AES-256-GCM a key also ends after kMostPackets, and wants_rekey() after half of them were
// sealed, or opened on the other side, where that many more would have to be lost. Nobody is told
// from forgeries either: 2^52 of AES-256-GCM and 2^36 of ChaCha20-Poly1305 (RFC 9001 §6.6) do not
// come within kRejectAfter, which would be 380 million packets a second.
//
// Opening is fed with any bytes from anywhere; a packet that is not authentic changes nothing.
// About 1.2 KB a path, with AES-256-GCM 2.2 KB. Secrets are erased with it. Pure;
// thread-compatible.
class Session {
 public:
  // Twice as many as a peer may have at a time, for those that come and go within kRekeyAfter.
  static constexpr std::size_t kMaxPaths = 2 * wire::kMaxReports;

  // How many packets one key of AES-256-GCM seals: RFC 9001 §6.6, whose packets may have 64 KiB;
  // with ours, which have less than 2 KiB, 2^28 would be as good (its appendix B.1). At 1 Gbit/s
  // that is 96 s. Not to be told by the packets' numbers, which go on by a million a second where a
  // path was taken away and comes back.
  static constexpr std::uint64_t kMostPackets = std::uint64_t{1} << 23U;

  enum class Role : std::uint8_t { kInitiator, kResponder };
  // `theirs`: the number by which the other side knows this session. `most_packets`: less than
  // kMostPackets in tests.
  Session(TimePoint born, Role role, std::uint32_t theirs, const Split& keys,
          std::uint64_t most_packets = kMostPackets);

  // The packet is a header, a body and room for the tag; it leaves sealed, with that number in its
  // header. A packet that belongs to no path's numbers is given one. `payload`: the last bytes of
  // the body where these lie elsewhere; what the packet has in their place is not read. False:
  // there is no room for its path, its number is not above all before, or its key has sealed what
  // it may; it must not leave.
  bool seal(std::span<std::byte> packet, ByteView payload = {});

  enum class Opened : std::uint8_t { kOk, kReplayed, kForged };
  // `out`: of the packet's size; holds the packet as it was before it was sealed, without its tag.
  Opened open(const wire::PacketHeader& header, ByteView packet, std::span<std::byte> out);

  TimePoint born() const { return born_; }
  bool is_over(TimePoint now) const { return now - born_ >= kRejectAfter; }
  // Another path would soon find no room, or a key has sealed half of what it may.
  bool wants_rekey() const { return is_worn_ || sending_.size() >= kMaxPaths - 1; }

 private:
  // A path by its number, or what belongs to none.
  using Lane = std::uint32_t;
  static constexpr Lane kControl = 0x10000;
  struct Sending {
    Lane lane = 0;
    PacketKey key;
    // The newest that was sealed, and how many were.
    std::uint64_t number = 0;
    std::uint64_t packets = 0;
  };
  struct Receiving {
    Receiving(Lane of, PacketKey&& k) : lane(of), key(std::move(k)) {}
    Lane lane;
    PacketKey key;
    // How many were opened.
    std::uint64_t packets = 0;
    ReplayWindow window;
  };
  static Lane lane_of(wire::PacketType type, LinkId path);
  PacketKey lane_key(const SecretKey& direction, Lane lane) const;
  void count(std::uint64_t& packets);
  Sending* sending(Lane lane);

  TimePoint born_;
  std::uint32_t theirs_;
  Cipher cipher_;
  std::uint64_t most_packets_;
  bool is_worn_ = false;
  SecretKey send_;
  SecretKey receive_;
  std::uint64_t next_control_ = 1;
  std::vector<Sending> sending_;
  std::vector<std::unique_ptr<Receiving>> receiving_;
};

}  // namespace interneuron::crypto
