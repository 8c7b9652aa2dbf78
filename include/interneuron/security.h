// Who an endpoint is and whom it trusts: keys as values. docs/threat_model.md says what they
// promise. Node and `interneuron keys` make and read them; the core never draws a key of its own.
//
// Plain values, but for SecretKey, which erases its bytes when it goes and compares in constant
// time.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace interneuron {

inline constexpr std::size_t kKeyBytes = 32;

// An X25519 public key (RFC 7748), which names a host; or the Ed25519 public key (RFC 8032) of a
// fleet authority.
using PublicKey = std::array<std::byte, kKeyBytes>;

// 32 bytes that nobody else may know: the private half of a key, or a key that two hosts share in
// advance. Zero by default. Copies are secrets of their own; each is erased when it is destroyed or
// replaced. Thread-compatible.
class SecretKey {
 public:
  SecretKey() = default;
  explicit SecretKey(std::span<const std::byte, kKeyBytes> bytes);
  SecretKey(const SecretKey&) = default;
  SecretKey& operator=(const SecretKey&) = default;
  ~SecretKey();

  std::span<const std::byte, kKeyBytes> bytes() const { return bytes_; }
  std::span<std::byte, kKeyBytes> writable() { return bytes_; }
  // In constant time.
  friend bool operator==(const SecretKey& a, const SecretKey& b);

 private:
  std::array<std::byte, kKeyBytes> bytes_{};
};

// The public half of an X25519 private key.
PublicKey public_key_of(const SecretKey& secret);

// A new secret: a private key, a key to share, a seed. Drawn by the host's system, on which the
// core never calls. Throws IoError. Thread-safe.
SecretKey random_key();

// Keys as people copy them: 44 characters of base64 (RFC 4648 §4), as WireGuard writes them.
// Nothing where the text is not exactly that.
std::string to_base64(std::span<const std::byte, kKeyBytes> key);
std::optional<PublicKey> parse_key(std::string_view text);

// A host that may talk to this one.
struct TrustedPeer {
  PublicKey key{};
  // The same at both ends, a second lock that holds even if X25519 falls. Default: zeros, none.
  SecretKey shared{};
};

inline constexpr std::size_t kSignatureBytes = 64;
// The name of a node has so many bytes at most.
inline constexpr std::size_t kNodeNameBytes = 16;
// A signed credential.
inline constexpr std::size_t kCredentialBytes =
    kKeyBytes + 1 + kNodeNameBytes + 2 * 8 + kSignatureBytes;
// The largest signed list of revocations: 2,000 keys and a little.
inline constexpr std::size_t kMaxRevocationsBytes = 64 * 1024;

// What a host is in a fleet.
enum class NodeRole : std::uint8_t { kVehicle = 0, kRoadside = 1 };
// "vehicle", "roadside".
std::string_view to_string(NodeRole role);

// What an authority says of a key: whose it is, and from when until when (seconds since 1970, the
// end not included).
struct Credential {
  PublicKey key{};
  NodeRole role = NodeRole::kVehicle;
  std::string node;
  std::int64_t not_before_s = 0;
  std::int64_t not_after_s = 0;
};

// Keys that an authority has signed or a host has listed, and that are to be trusted no more; as of
// a time. A later list replaces all before it.
struct Revocations {
  std::int64_t issued_s = 0;
  std::vector<PublicKey> keys;
};

// Who is believed when the list of revocations is older than it may be, or there is none though one
// is wanted.
enum class StaleRevocations : std::uint8_t {
  // Everybody whose credential holds: fail open.
  kAccept,
  // Nobody but the hosts that are listed: fail closed.
  kRefuse,
};

// What an endpoint proves itself with, and whom it believes. An endpoint with these talks to no one
// in the clear, and nothing of anybody else's is used.
struct Security {
  // Our own X25519 private key. No default.
  SecretKey key = {};
  // The hosts that may join, where peers are accepted, and those that may be connected to.
  std::vector<TrustedPeer> peers = {};
  // Ed25519 keys of fleet authorities: a vehicle that shows a credential signed by one of them may
  // join too. Two while one takes the place of the other. Revocations of theirs count for all keys.
  std::vector<PublicKey> authorities = {};
  // Our own credential, signed; empty: none is shown.
  std::vector<std::byte> credential = {};
  // The newest signed list that this host knows; empty: none. Lists that peers hand on are told of
  // by RevocationsChanged.
  std::vector<std::byte> revocations = {};
  // How old the list may be, in seconds, and what happens then. 0: any age, and none is wanted.
  std::int64_t max_revocations_age_s = 0;
  StaleRevocations stale_revocations = StaleRevocations::kRefuse;
  // Random bytes from which ephemeral keys are drawn; used once, so never give the same twice.
  SecretKey seed = {};
  // The time of day when the endpoint is made, in ns since 1970: what this host has stored if that
  // is later than its clock says. Peers refuse a handshake that is not newer than the one before.
  std::int64_t unix_time_ns = 0;
};

}  // namespace interneuron
