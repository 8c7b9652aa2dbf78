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

// What an endpoint proves itself with, and whom it believes. An endpoint with these talks to no one
// in the clear, and nothing of anybody else's is used.
struct Security {
  // Our own X25519 private key. No default.
  SecretKey key;
  // The hosts that may join, where peers are accepted, and those that may be connected to.
  std::vector<TrustedPeer> peers;
  // Random bytes from which ephemeral keys are drawn; used once, so never give the same twice.
  SecretKey seed;
  // The time of day when the endpoint is made, in ns since 1970: what this host has stored if that
  // is later than its clock says. Peers refuse a handshake that is not newer than the one before.
  std::int64_t unix_time_ns = 0;
};

}  // namespace interneuron
