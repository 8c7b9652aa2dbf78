// What secure_bench is made of: the table of figures, keys that follow from numbers, and
// a vehicle that asks for a session.
#pragma once

#include <fmt/format.h>

#include <sodium.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "bench/cpu_time.h"
#include "core/secure/entropy.h"
#include "core/secure/handshake.h"
#include "core/wire/packet.h"
#include "interneuron/endpoint.h"

namespace interneuron::bench {

inline constexpr LinkId kNic{1};
// Packets between two readings of the clock, so that reading it does not count.
inline constexpr std::size_t kBatch = 64;

// What `work` takes.
template <typename Work>
double us_of(Work&& work) {
  const double begin = thread_us();
  work();
  return thread_us() - begin;
}

inline void expect(bool holds, const char* what) {
  if (!holds) throw std::runtime_error(what);
}

// A figure for each round, in the order in which they were first told.
class Table {
 public:
  void add(const std::string& name, double value) {
    const auto it = std::ranges::find(rows_, name, &Row::name);
    Row& row = it == rows_.end() ? rows_.emplace_back(Row{name, {}}) : *it;
    row.values.push_back(value);
  }
  void print(const std::string& heading) {
    fmt::print("{:<58}{:>10}{:>10}\n", heading, "least", "median");
    for (Row& row : rows_) {
      std::ranges::sort(row.values);
      fmt::print("  {:<56}{:10.3f}{:10.3f}\n", row.name, row.values.front(),
                 row.values[row.values.size() / 2]);
    }
  }

 private:
  struct Row {
    std::string name;
    std::vector<double> values;
  };
  std::vector<Row> rows_;
};

inline SecretKey key_of(std::uint32_t number) {
  std::array<std::byte, kKeyBytes> bytes{};
  for (std::size_t i = 0; i < sizeof(number); ++i) {
    bytes[i] = static_cast<std::byte>(number >> (8 * i));
  }
  // Zero means that there is none.
  bytes.back() = std::byte{1};
  return SecretKey(bytes);
}

inline Address address_of_host(std::uint32_t host) {
  Address a{.size = sizeof(host)};
  for (std::size_t i = 0; i < sizeof(host); ++i) a.raw[i] = static_cast<std::byte>(host >> (8 * i));
  return a;
}

inline Bytes packet(std::size_t bytes, LinkId path, std::uint64_t number) {
  Bytes out(bytes);
  wire::write_probe(out, {wire::PacketType::kProbe, path, wire::kClearEpoch, SessionId{7}, number},
                    bytes);
  return out;
}

// A vehicle that asks for a session; its keys follow from its number.
class Vehicle {
 public:
  Vehicle(std::uint32_t number, const PublicKey& road)
      : number_(number),
        initiator_(crypto::key_pair_of(key_of(number)), {road, {}}, SessionId{number}),
        entropy_(key_of(~number)) {}

  // Begins anew, and draws what a new message is made of.
  void begin(TimePoint now) {
    initiator_.stop();
    initiator_.begin(now);
    fresh_ = {entropy_.draw_index(), entropy_.draw_key(), now.time_since_epoch().count()};
  }
  void ask(TimePoint now) {
    expect(initiator_.make_message(now, fresh_), "no message was made");
    initiator_.write(LinkId{0}, initiation_);
  }
  std::optional<crypto::Initiator::Answer> take(ByteView response) {
    return initiator_.take_response(response);
  }

  wire::PacketHeader header() const { return *wire::peek(initiation_); }
  Datagram datagram() const { return {kNic, address_of_host(number_), initiation_}; }
  Bytes& initiation() { return initiation_; }

 private:
  std::uint32_t number_;
  crypto::Initiator initiator_;
  crypto::Entropy entropy_;
  crypto::Initiator::Fresh fresh_;
  Bytes initiation_ = Bytes(crypto::kInitiationBytes);
};

// libsodium with the same bytes as a session: the header's are associated, the tag is the packet's
// last ones.
class Alone {
 public:
  Alone(std::size_t bytes, crypto::Cipher cipher)
      : packets_(kBatch, Bytes(bytes)), opened_(bytes), cipher_(cipher) {
    if (cipher == crypto::Cipher::kAesGcm) crypto_aead_aes256gcm_beforenm(&aes_, key_.data());
  }

  void seal() {
    for (Bytes& p : packets_) {
      if (cipher_ == crypto::Cipher::kAesGcm) {
        crypto_aead_aes256gcm_encrypt_detached_afternm(
            body(p), tag(p), nullptr, body(p), body_bytes(), at(p, 0), wire::kAssociatedBytes,
            nullptr, nonce_.data(), &aes_);
      } else {
        crypto_aead_chacha20poly1305_ietf_encrypt_detached(
            body(p), tag(p), nullptr, body(p), body_bytes(), at(p, 0), wire::kAssociatedBytes,
            nullptr, nonce_.data(), key_.data());
      }
    }
  }
  void open() {
    for (Bytes& p : packets_) {
      expect(opens(p) == 0, "libsodium does not open what it has sealed");
    }
  }

 private:
  int opens(Bytes& p) {
    unsigned char* const out = at(opened_, wire::kAssociatedBytes);
    if (cipher_ == crypto::Cipher::kAesGcm) {
      return crypto_aead_aes256gcm_decrypt_detached_afternm(
          out, nullptr, body(p), body_bytes(), tag(p), at(p, 0), wire::kAssociatedBytes,
          nonce_.data(), &aes_);
    }
    return crypto_aead_chacha20poly1305_ietf_decrypt_detached(
        out, nullptr, body(p), body_bytes(), tag(p), at(p, 0), wire::kAssociatedBytes,
        nonce_.data(), key_.data());
  }
  static unsigned char* at(Bytes& bytes, std::size_t place) {
    return reinterpret_cast<unsigned char*>(bytes.data()) + place;
  }
  unsigned char* body(Bytes& p) const { return at(p, wire::kAssociatedBytes); }
  unsigned char* tag(Bytes& p) const { return at(p, p.size() - wire::kTagBytes); }
  std::size_t body_bytes() const {
    return opened_.size() - wire::kAssociatedBytes - wire::kTagBytes;
  }

  std::vector<Bytes> packets_;
  Bytes opened_;
  // The same for all packets: nobody else sees them, and it takes as long.
  std::array<unsigned char, crypto_aead_chacha20poly1305_ietf_NPUBBYTES> nonce_{};
  std::array<unsigned char, crypto_aead_chacha20poly1305_ietf_KEYBYTES> key_{1};
  crypto::Cipher cipher_;
  crypto_aead_aes256gcm_state aes_{};
};

// Those that there are. `portable`: libsodium is not to look at the processor.
inline std::vector<crypto::Cipher> ciphers(bool portable) {
  using crypto::Cipher;
  if (portable || crypto::ciphers_here() == 0) return {Cipher::kChaChaPoly};
  return {Cipher::kChaChaPoly, Cipher::kAesGcm};
}

inline std::string_view name_of(crypto::Cipher cipher) {
  return cipher == crypto::Cipher::kAesGcm ? "AES-256-GCM" : "ChaCha20-Poly1305";
}

}  // namespace interneuron::bench
