// Keys, handshakes and sealed packets of somebody who keeps to no rule: he has a key of his own,
// or knows no more than the road's public one. Whatever a host would refuse to seal is sealed:
// any number, any type, twice under one key. Nothing that comes is checked for replays.
#pragma once

#include <cstdint>
#include <optional>
#include <random>
#include <string>

#include "core/secure/handshake.h"
#include "core/wire/packet.h"
#include "interneuron/security.h"
#include "interneuron/units.h"

namespace interneuron::attacker {

struct Keys {
  SecretKey own;
  PublicKey road{};
};
// The key in a file as `interneuron keys gen` writes it. Throws std::runtime_error that names it.
SecretKey read_key(const std::string& file);
// 44 characters of base64. Throws std::runtime_error that names them.
PublicKey read_public_key(const std::string& text);
// Good enough for what protects nothing.
SecretKey draw_key(std::mt19937_64& random);
std::int64_t unix_time_ns();

class SealedChannel {
 public:
  // `life`: what the road is told that we are.
  SealedChannel(const Keys& keys, SessionId life, std::mt19937_64& random);

  // An initiation for path 0 where one is due: at first, when it was not answered, and before the
  // keys are over. Else empty.
  Bytes poll(TimePoint now);

  struct Took {
    // A packet that was sealed for us, as it was before.
    Bytes opened;
    // What a response has brought.
    std::optional<wire::Token> token;
  };
  // Any bytes.
  Took take(TimePoint now, ByteView packet);

  // A handshake was answered: from now on packets can be sealed.
  bool is_open() const { return index_ != 0; }
  // The road's life.
  std::uint32_t life() const { return life_; }
  // A packet that was written in the clear, with the number that it has.
  void seal(std::span<std::byte> packet) const;

 private:
  std::mt19937_64& random_;
  crypto::Initiator initiator_;
  // The number of our keys at the road, and of the road's at us.
  std::uint32_t index_ = 0;
  std::uint32_t own_index_ = 0;
  std::uint32_t life_ = 0;
  crypto::Split keys_;
  TimePoint renew_at_{};
};

}  // namespace interneuron::attacker
