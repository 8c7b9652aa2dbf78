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
// Opening is fed with any bytes from anywhere; a packet that is not authentic changes nothing.
// About 1.2 KB a path. Secrets are erased with it. Pure; thread-compatible.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "core/secure/noise.h"
#include "core/secure/replay_window.h"
#include "core/wire/packet.h"
#include "interneuron/time.h"

namespace interneuron::crypto {

inline constexpr Duration kRekeyAfter = std::chrono::seconds(120);
inline constexpr Duration kRejectAfter = std::chrono::seconds(180);

class Session {
 public:
  // Twice as many as a peer may have at a time, for those that come and go within kRekeyAfter.
  static constexpr std::size_t kMaxPaths = 2 * wire::kMaxReports;

  enum class Role : std::uint8_t { kInitiator, kResponder };
  // `theirs`: the number by which the other side knows this session.
  Session(TimePoint born, Role role, std::uint32_t theirs, const Split& keys);

  // The packet is a header, a body and room for the tag; it leaves sealed, with that number in its
  // header. A packet that belongs to no path's numbers is given one. `payload`: the last bytes of
  // the body where these lie elsewhere; what the packet has in their place is not read. False:
  // there is no room for its path, or its number is not above all before; it must not leave.
  bool seal(std::span<std::byte> packet, ByteView payload = {});

  enum class Opened : std::uint8_t { kOk, kReplayed, kForged };
  // `out`: of the packet's size; holds the packet as it was before it was sealed, without its tag.
  Opened open(const wire::PacketHeader& header, ByteView packet, std::span<std::byte> out);

  TimePoint born() const { return born_; }
  bool is_over(TimePoint now) const { return now - born_ >= kRejectAfter; }
  // Another path would soon find no room.
  bool wants_rekey() const { return sending_.size() >= kMaxPaths - 1; }

 private:
  // A path by its number, or what belongs to none.
  using Lane = std::uint32_t;
  static constexpr Lane kControl = 0x10000;
  struct Sending {
    Lane lane = 0;
    SecretKey key;
    // The newest that was sealed.
    std::uint64_t number = 0;
  };
  struct Receiving {
    Lane lane = 0;
    SecretKey key;
    ReplayWindow window;
  };
  static Lane lane_of(wire::PacketType type, LinkId path);
  Sending* sending(Lane lane);

  TimePoint born_;
  std::uint32_t theirs_;
  SecretKey send_;
  SecretKey receive_;
  std::uint64_t next_control_ = 1;
  std::vector<Sending> sending_;
  std::vector<std::unique_ptr<Receiving>> receiving_;
};

}  // namespace interneuron::crypto
