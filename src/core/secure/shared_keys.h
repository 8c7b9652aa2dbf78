// Which keys two hosts use: a life that was followed by another one does not come back by itself,
// so that a second host has the key where it does. Told of every life that is adopted; bounded by
// kMaxKeysWithLives keys of kMaxLives each. Pure; thread-compatible.
#pragma once

#include <deque>
#include <map>
#include <optional>
#include <vector>

#include "interneuron/security.h"
#include "interneuron/time.h"
#include "interneuron/units.h"

namespace interneuron::crypto {

class SharedKeys {
 public:
  // Lives of one key that are remembered, and keys of which they are.
  static constexpr std::size_t kMaxLives = 8;
  static constexpr std::size_t kMaxKeysWithLives = 1024;
  // A key is told of again after so long at the earliest.
  static constexpr Duration kBetweenSharedKeys = std::chrono::minutes(1);

  void note_life(TimePoint now, const PublicKey& who, SessionId life) {
    if (!lives_.contains(who) && lives_.size() >= kMaxKeysWithLives) lives_.erase(lives_.begin());
    Lives& lives = lives_[who];
    if (!lives.known.empty() && lives.known.back() == life) return;
    const bool is_back = std::erase(lives.known, life) > 0;
    lives.known.push_back(life);
    if (lives.known.size() > kMaxLives) lives.known.erase(lives.known.begin());
    const bool is_told =
        lives.told_at != TimePoint::min() && now - lives.told_at < kBetweenSharedKeys;
    if (!is_back || is_told) return;
    lives.told_at = now;
    shared_.push_back(who);
  }
  // A key that two hosts use; ask until nothing comes.
  std::optional<PublicKey> poll() {
    if (shared_.empty()) return std::nullopt;
    const PublicKey key = shared_.front();
    shared_.pop_front();
    return key;
  }

 private:
  // The lives that a key has had lately, newest last.
  struct Lives {
    std::vector<SessionId> known;
    TimePoint told_at = TimePoint::min();
  };
  std::map<PublicKey, Lives> lives_;
  std::deque<PublicKey> shared_;
};

}  // namespace interneuron::crypto
