// Random bytes without a system call: a stream that a seed of the host's begins. After each draw
// the state is replaced by other bytes of the stream and erased (fast key erasure), so that whoever
// steals the state later cannot compute what was drawn before, which ephemeral keys rely on.
//
// Two streams from one seed are the same: a seed is used once. Pure; thread-compatible.
#pragma once

#include <cstdint>
#include <span>

#include "interneuron/security.h"
#include "interneuron/shard.h"

namespace interneuron::crypto {

class Entropy {
 public:
  explicit Entropy(const SecretKey& seed) : state_(seed) {}

  SecretKey draw_key();
  // A number of a session: any value but 0, whose last byte tells the shard where there are
  // several.
  std::uint32_t draw_index(const Shard& shard = {});
  // In [0, below), for what need not be exactly even.
  std::uint64_t draw_below(std::uint64_t below);

 private:
  SecretKey state_;
};

}  // namespace interneuron::crypto
