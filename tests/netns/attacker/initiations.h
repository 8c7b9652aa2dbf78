// Initiations of handshakes from nobody whom the road trusts, with a mac1 that fits, since the
// attacker knows the road's public key: cheap ones of random bytes, and whole ones of keys of his
// own, which cost the road as much as one of a host that it trusts. And their answers to cookies.
#pragma once

#include <random>
#include <vector>

#include "core/secure/handshake.h"
#include "interneuron/security.h"
#include "interneuron/units.h"

namespace interneuron::attacker {

class Initiations {
 public:
  Initiations(const PublicKey& road, std::mt19937_64& random);

  // Random bytes where the message of Noise should be. Valid until the next call.
  ByteView random();
  // One of those that are whole, without mac2.
  ByteView whole();
  // What answers a cookie for one of whole(); empty where it is none. Valid until the next call.
  ByteView with_cookie(ByteView cookie);

 private:
  void put_code(const SecretKey& key, ByteView before, ByteView at);

  std::mt19937_64& random_;
  SecretKey mac1_key_;
  SecretKey cookie_key_;
  Bytes buffer_;
  std::vector<Bytes> whole_;
};

}  // namespace interneuron::attacker
