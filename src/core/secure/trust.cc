#include "core/secure/trust.h"

#include <stdexcept>

namespace interneuron::crypto {
namespace {

// One that is, and one that comes in its place.
constexpr std::size_t kMaxAuthorities = 2;

}  // namespace

Trust::Trust(const Security& security)
    : authorities_(security.authorities),
      max_age_s_(security.max_revocations_age_s),
      stale_(security.stale_revocations) {
  for (const TrustedPeer& peer : security.peers) peers_.emplace(peer.key, peer.shared);
  if (authorities_.size() > kMaxAuthorities) {
    throw std::invalid_argument("security: there are more than two authorities");
  }
  if (!security.credential.empty() && security.credential.size() != kCredentialBytes) {
    throw std::invalid_argument("security: the credential is none");
  }
  if (!security.revocations.empty() && !take_revocations(security.revocations)) {
    throw std::invalid_argument("security: no authority has signed the list of revocations");
  }
}

std::optional<SecretKey> Trust::may_connect(const PublicKey& who) const {
  const auto listed = peers_.find(who);
  if (listed == peers_.end() || is_revoked(who)) return std::nullopt;
  return listed->second;
}

std::optional<SecretKey> Trust::may_join(const PublicKey& who, ByteView credential,
                                         std::int64_t unix_s) const {
  if (is_revoked(who)) return std::nullopt;
  const auto listed = peers_.find(who);
  if (listed != peers_.end()) return listed->second;
  if (authorities_.empty() || credential.empty() || is_closed(unix_s)) return std::nullopt;
  // The signature last: it takes as long as everything else of a handshake, and anybody may ask.
  const auto shown = parse_credential(credential);
  const bool fits = shown && shown->key == who && shown->role == NodeRole::kVehicle &&
                    is_valid_at(*shown, unix_s) && read_credential(credential, authorities_);
  return fits ? std::optional<SecretKey>(SecretKey{}) : std::nullopt;
}

std::optional<PublicKey> Trust::only_peer() const {
  if (peers_.size() != 1) return std::nullopt;
  return peers_.begin()->first;
}

bool Trust::is_revoked(const PublicKey& who) const { return crypto::is_revoked(list_, who); }

bool Trust::take_revocations(ByteView bytes) {
  auto list = read_revocations(bytes, authorities_);
  if (!list || list->issued_s <= list_.issued_s) return false;
  list_ = std::move(*list);
  signed_list_.assign(bytes.begin(), bytes.end());
  return true;
}

bool Trust::is_closed(std::int64_t unix_s) const {
  return max_age_s_ > 0 && stale_ == StaleRevocations::kRefuse &&
         unix_s - list_.issued_s > max_age_s_;
}

}  // namespace interneuron::crypto
