// Well-formed packets of every type with fields that an input chooses, the values that matter more
// often than others: what reaches behind the parser where mutated bytes seldom do. Pure.
#pragma once

#include <cstdint>
#include <optional>

#include "interneuron/time.h"
#include "interneuron/units.h"
#include "tests/fuzz/input.h"

namespace interneuron::fuzz {

// What the sender of a packet knows.
struct Sender {
  SessionId session{};
  LinkId link{};
  // The next packet number of this sender on this link, and the number of the newest packet that
  // the endpoint has sent here.
  std::uint64_t next_number = 1;
  std::uint64_t heard_number = 0;
  TimePoint now{};
  // The session of the endpoint that the packet goes to.
  SessionId endpoint{};
};

enum class Kind : std::uint8_t {
  kPlainMessage,
  kRoundMessage,
  kPiece,
  kFeedback,
  kProbe,
  kEcho,
  kWindow,
  kUnused,
};
inline constexpr std::size_t kKinds = 8;

// A packet of this kind. The bytes of the input that it takes depend on the kind.
Bytes any_packet(Input& input, const Sender& sender, Kind kind);

// The answer to a challenge (type 8) with this token. `with_session`: the sender's session stands
// before it.
Bytes answer_packet(Input& input, const Sender& sender, ByteView token, bool with_session);

}  // namespace interneuron::fuzz
