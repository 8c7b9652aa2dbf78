// Whom an endpoint trusts: the hosts that its configuration lists, and those that an authority has
// signed, but for those whose keys are revoked. Owned by Sessions; lists of revocations come from
// the host and from peers, who may be anybody that was admitted: only the authorities' signatures
// count. Bounded by kMaxRevocationsBytes. Pure; thread-compatible.
#pragma once

#include <map>
#include <optional>

#include "core/secure/credential.h"
#include "interneuron/security.h"

namespace interneuron::crypto {

class Trust {
 public:
  // Throws std::invalid_argument that names what of the security cannot be right.
  explicit Trust(const Security& security);

  // The shared key of a host that may be connected to; nothing where it is not trusted.
  std::optional<SecretKey> may_connect(const PublicKey& who) const;
  // The same of one that asks, and shows this credential, or nothing, at this time.
  std::optional<SecretKey> may_join(const PublicKey& who, ByteView credential,
                                    std::int64_t unix_s) const;
  // The only host that is listed.
  std::optional<PublicKey> only_peer() const;

  bool is_revoked(const PublicKey& who) const;
  // Takes a signed list that is newer than the one there is. False: it is none.
  bool take_revocations(ByteView bytes);
  // The newest list, signed; empty: there is none. And when it was issued, 0: there is none.
  const Bytes& revocations() const { return signed_list_; }
  std::int64_t revocations_s() const { return list_.issued_s; }
  // Whether nobody but listed hosts is believed, since the list is too old.
  bool is_closed(std::int64_t unix_s) const;

 private:
  std::map<PublicKey, SecretKey> peers_;
  std::vector<PublicKey> authorities_;
  std::int64_t max_age_s_;
  StaleRevocations stale_;
  Revocations list_;
  Bytes signed_list_;
};

}  // namespace interneuron::crypto
