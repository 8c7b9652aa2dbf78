// The handshake against published vectors: those of flynn/noise, which Debian ships.
#include "core/secure/noise.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sodium.h>

#include <array>
#include <fstream>
#include <map>

#include "core/secure/aead.h"
#include "core/secure/bytes.h"
#include "lab/sim/trust.h"

namespace interneuron::crypto::noise_test {
namespace {

constexpr const char* kVectors = "/usr/share/gocode/src/github.com/flynn/noise/vectors.txt";

using Vector = std::map<std::string, std::string>;

std::vector<Vector> vectors(const std::string& name) {
  std::vector<Vector> out;
  std::ifstream file(kVectors);
  Vector next;
  for (std::string line; std::getline(file, line);) {
    const std::size_t equals = line.find('=');
    if (equals != std::string::npos) {
      next[line.substr(0, equals)] = line.substr(equals + 1);
      continue;
    }
    if (next["handshake"] == name) out.push_back(next);
    next.clear();
  }
  if (next["handshake"] == name) out.push_back(next);
  return out;
}

Bytes unhex(const std::string& text) {
  if (text.empty()) return {};
  Bytes out(text.size() / 2);
  if (out.empty()) return out;
  std::size_t size = 0;
  EXPECT_EQ(
      sodium_hex2bin(target(out), out.size(), text.data(), text.size(), nullptr, &size, nullptr),
      0);
  EXPECT_EQ(size, out.size());
  return out;
}

SecretKey key_of(const std::string& text) {
  return text.empty() ? SecretKey{} : SecretKey(std::span<const std::byte, kKeyBytes>(unhex(text)));
}

// Carries one message over and says what it was.
Bytes carry(const Vector& v, int i,
            const std::function<bool(std::span<std::byte>, ByteView)>& write,
            const std::function<bool(ByteView, std::span<std::byte>)>& read, std::size_t overhead) {
  const std::string prefix = "msg_" + std::to_string(i);
  const Bytes payload = unhex(v.at(prefix + "_payload"));
  Bytes message(payload.size() + overhead);
  EXPECT_TRUE(write(message, payload));
  Bytes got(payload.size());
  EXPECT_TRUE(read(message, got));
  EXPECT_EQ(got, payload);
  return message;
}

void check(const Vector& v, Noise::Pattern pattern) {
  const auto at = [&v](const std::string& name) {
    const auto it = v.find(name);
    return it == v.end() ? std::string() : it->second;
  };
  const KeyPair initiator = key_pair_of(key_of(at("init_static")));
  const KeyPair responder = key_pair_of(key_of(at("resp_static")));
  const Bytes prologue = unhex(at("prologue"));
  Noise i = Noise::initiator(pattern, prologue, initiator,
                             key_pair_of(key_of(at("gen_init_ephemeral"))), responder.open);
  Noise r = Noise::responder(pattern, prologue, responder, key_of(at("gen_resp_ephemeral")));
  i.set_shared(key_of(at("preshared_key")));
  r.set_shared(key_of(at("preshared_key")));
  EXPECT_EQ(carry(
                v, 0, [&](auto out, auto in) { return i.write_first(out, in); },
                [&](auto in, auto out) { return r.read_first(in, out); }, kFirstMessageBytes),
            unhex(v.at("msg_0_ciphertext")));
  EXPECT_EQ(r.remote(), initiator.open);
  EXPECT_EQ(i.early_key("any"), r.early_key("any"));
  EXPECT_EQ(carry(
                v, 1, [&](auto out, auto in) { return r.write_second(out, in); },
                [&](auto in, auto out) { return i.read_second(in, out); }, kSecondMessageBytes),
            unhex(v.at("msg_1_ciphertext")));
  EXPECT_EQ(i.hash(), r.hash());
  const Split keys = i.split();
  EXPECT_EQ(keys.from_initiator, r.split().from_initiator);
  EXPECT_EQ(keys.from_responder, r.split().from_responder);
  for (int m = 2; m < 4; ++m) {
    const SecretKey& key = m == 2 ? keys.from_initiator : keys.from_responder;
    const auto seal = [&key](std::span<std::byte> out, ByteView in) {
      aead_seal(key, 0, {}, in, out.first(in.size()), out.subspan(in.size()));
      return true;
    };
    const auto open = [&key](ByteView in, std::span<std::byte> out) {
      return aead_open(key, 0, {}, in.first(out.size()), in.subspan(out.size()), out);
    };
    EXPECT_EQ(carry(v, m, seal, open, kAeadTagBytes),
              unhex(v.at("msg_" + std::to_string(m) + "_ciphertext")));
  }
}

TEST(Noise, HasThePublishedVectors) {
  if (!std::ifstream(kVectors)) GTEST_SKIP() << "install golang-github-flynn-noise-dev";
  const auto ik = vectors("Noise_IK_25519_ChaChaPoly_SHA256");
  const auto psk = vectors("Noise_IKpsk2_25519_ChaChaPoly_SHA256");
  EXPECT_EQ(ik.size(), 4U);
  EXPECT_EQ(psk.size(), 4U);
  for (const Vector& v : ik) check(v, Noise::Pattern::kIk);
  for (const Vector& v : psk) check(v, Noise::Pattern::kIkPsk2);
}

struct Both {
  KeyPair own = key_pair_of(sim::secret_key(1));
  KeyPair other = key_pair_of(sim::secret_key(2));
  Noise initiator = Noise::initiator(Noise::Pattern::kIkPsk2, {}, own,
                                     key_pair_of(sim::secret_key(3)), other.open);
  Noise responder = Noise::responder(Noise::Pattern::kIkPsk2, {}, other, sim::secret_key(4));
  Bytes first = Bytes(kFirstMessageBytes + 5);
  Bytes second = Bytes(kSecondMessageBytes + 5);
  Bytes payload = Bytes(5);

  Both() { EXPECT_TRUE(initiator.write_first(first, Bytes(5, std::byte{7}))); }
};

TEST(Noise, NeitherMessageMayBeChangedInAnyBit) {
  const Both pristine;
  for (std::size_t bit = 0; bit < 8 * pristine.first.size(); ++bit) {
    Both b;
    b.first[bit / 8] ^= std::byte{1} << bit % 8;
    EXPECT_FALSE(b.responder.read_first(b.first, b.payload)) << bit;
  }
  Both reading;
  ASSERT_TRUE(reading.responder.read_first(reading.first, reading.payload));
  ASSERT_TRUE(reading.responder.write_second(reading.second, Bytes(5)));
  for (std::size_t bit = 0; bit < 8 * reading.second.size(); ++bit) {
    Both b;
    b.second = reading.second;
    b.second[bit / 8] ^= std::byte{1} << bit % 8;
    EXPECT_FALSE(b.initiator.read_second(b.second, b.payload)) << bit;
  }
}

TEST(Noise, OtherSizesAreRefused) {
  Both b;
  for (std::size_t size = 0; size < 200; ++size) {
    if (size == b.first.size()) continue;
    EXPECT_FALSE(b.responder.read_first(Bytes(size), b.payload));
  }
}

TEST(Noise, WhoDoesNotShareTheKeyIsRefused) {
  Both b;
  b.initiator.set_shared(sim::secret_key(9));
  ASSERT_TRUE(b.responder.read_first(b.first, b.payload));
  ASSERT_TRUE(b.responder.write_second(b.second, Bytes(5)));
  EXPECT_FALSE(b.initiator.read_second(b.second, b.payload));
}

// The points of Curve25519 whose shared secret is zero, whatever the other key is: "Curve25519: new
// Diffie-Hellman speed records", Bernstein; the list is libsodium's.
TEST(Noise, KeysOfLowOrderAreRefused) {
  const std::array<const char*, 7> points{
      "0000000000000000000000000000000000000000000000000000000000000000",
      "0100000000000000000000000000000000000000000000000000000000000000",
      "e0eb7a7c3b41b8ae1656e3faf19fc46ada098deb9c32b1fd866205165f49b800",
      "5f9c95bca3508c24b1d0b1559c83ef5b04445cc4581c8e86d8224eddd09f1157",
      "ecffffffffffffffffffffffffffffffffffffffffffffffffffffffffffff7f",
      "edffffffffffffffffffffffffffffffffffffffffffffffffffffffffffff7f",
      "eeffffffffffffffffffffffffffffffffffffffffffffffffffffffffffff7f"};
  for (const char* point : points) {
    Both b;
    PublicKey low{};
    std::ranges::copy(unhex(point), low.begin());
    Noise to_it =
        Noise::initiator(Noise::Pattern::kIkPsk2, {}, b.own, key_pair_of(sim::secret_key(3)), low);
    EXPECT_FALSE(to_it.write_first(b.first, Bytes(5))) << point;
    std::ranges::copy(low, b.first.begin());
    EXPECT_FALSE(b.responder.read_first(b.first, b.payload)) << point;
  }
}

}  // namespace
}  // namespace interneuron::crypto::noise_test
