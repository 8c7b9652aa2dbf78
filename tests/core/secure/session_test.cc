// What is sealed is opened once, by the other side, as it was, and nothing else is.
#include "core/secure/session.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

namespace interneuron::crypto::session_test {
namespace {

using namespace std::chrono_literals;
using Opened = Session::Opened;

constexpr TimePoint kBorn{1h};

Split keys_of(int seed, Cipher cipher = Cipher::kChaChaPoly) {
  std::array<std::byte, kKeyBytes> a{};
  a.fill(static_cast<std::byte>(seed));
  std::array<std::byte, kKeyBytes> b{};
  b.fill(static_cast<std::byte>(seed + 100));
  return {SecretKey(a), SecretKey(b), cipher};
}

struct Both {
  Cipher cipher = Cipher::kChaChaPoly;
  Session vehicle{kBorn, Session::Role::kInitiator, 22, keys_of(1, cipher)};
  Session road{kBorn, Session::Role::kResponder, 11, keys_of(1, cipher)};
};

// Those that this machine has.
std::vector<Cipher> ciphers() {
  if (ciphers_here() == 0) return {Cipher::kChaChaPoly};
  return {Cipher::kChaChaPoly, Cipher::kAesGcm};
}

Bytes probe(std::uint64_t number, std::uint16_t path = 3, std::size_t size = 100,
            wire::PacketType type = wire::PacketType::kProbe) {
  Bytes out(size);
  wire::write_probe(out, {type, LinkId{path}, wire::kClearEpoch, SessionId{7}, number, 0x01020304},
                    size);
  for (std::size_t i = wire::kHeaderBytes; i < size - wire::kTagBytes; ++i) {
    out[i] = static_cast<std::byte>(i);
  }
  return out;
}

Opened open(Session& by, const Bytes& packet, Bytes* into = nullptr) {
  Bytes out(std::max<std::size_t>(packet.size(), 1400));
  const auto header = wire::peek(packet);
  if (!header) return Opened::kForged;
  const Opened result = by.open(*header, packet, out);
  if (into != nullptr) *into = out;
  return result;
}

TEST(Session, OpensWhatTheOtherSideHasSealedOnce) {
  for (const Cipher cipher : ciphers()) {
    Both b{cipher};
    const Bytes clear = probe(5);
    Bytes packet = clear;
    ASSERT_TRUE(b.vehicle.seal(packet));
    const auto header = wire::peek(packet);
    EXPECT_EQ(header->session, SessionId{22});
    EXPECT_EQ(header->epoch, wire::kSealedEpoch);
    // Neither the stamp nor the body can be seen.
    EXPECT_FALSE(
        std::ranges::equal(std::span(packet).subspan(16, 68), std::span(clear).subspan(16, 68)));
    Bytes opened;
    EXPECT_EQ(open(b.road, packet, &opened), Opened::kOk);
    EXPECT_TRUE(
        std::ranges::equal(std::span(opened).subspan(16, 68), std::span(clear).subspan(16, 68)));
    EXPECT_EQ(open(b.road, packet), Opened::kReplayed);
    // Not its own.
    Bytes own = probe(6);
    ASSERT_TRUE(b.vehicle.seal(own));
    EXPECT_EQ(open(b.vehicle, own), Opened::kForged);
  }
}

TEST(Session, NeitherABitNorTheLengthMayChange) {
  for (const Cipher cipher : ciphers()) {
    Both b{cipher};
    Bytes packet = probe(5);
    ASSERT_TRUE(b.vehicle.seal(packet));
    for (std::size_t bit = 0; bit < 8 * packet.size(); ++bit) {
      Bytes changed = packet;
      changed[bit / 8] ^= std::byte{1} << bit % 8;
      // The number of the session is only a name: Sessions finds other keys by another one.
      if (bit / 8 >= 4 && bit / 8 < 8) continue;
      EXPECT_EQ(open(b.road, changed), Opened::kForged) << bit;
    }
    for (std::size_t size = 0; size < packet.size(); ++size) {
      EXPECT_EQ(
          open(b.road, Bytes(packet.begin(), packet.begin() + static_cast<std::ptrdiff_t>(size))),
          Opened::kForged);
    }
    Bytes longer = packet;
    longer.push_back({});
    EXPECT_EQ(open(b.road, longer), Opened::kForged);
    EXPECT_EQ(open(b.road, packet), Opened::kOk);
  }
}

TEST(Session, APacketOfOnePathIsNoneOfAnotherNorOfAnotherHandshake) {
  Both b;
  Bytes packet = probe(5, 3);
  ASSERT_TRUE(b.vehicle.seal(packet));
  Bytes other = packet;
  other[3] = std::byte{4};
  EXPECT_EQ(open(b.road, other), Opened::kForged);
  Session next(kBorn, Session::Role::kResponder, 11, keys_of(2));
  EXPECT_EQ(open(next, packet), Opened::kForged);
}

TEST(Session, WhatOneCipherHasSealedTheOtherDoesNotOpen) {
  if (ciphers().size() < 2) GTEST_SKIP() << "this machine has one";
  for (const Cipher cipher : ciphers()) {
    Both sealing{cipher};
    Both opening{cipher == Cipher::kAesGcm ? Cipher::kChaChaPoly : Cipher::kAesGcm};
    Bytes packet = probe(5);
    ASSERT_TRUE(sealing.vehicle.seal(packet));
    EXPECT_EQ(open(opening.road, packet), Opened::kForged);
    EXPECT_EQ(open(sealing.road, packet), Opened::kOk);
  }
}

// RFC 9001 §6.6; with fewer packets, so that it is soon over.
TEST(Session, AKeyOfAesEndsAfterItsPacketsAndBothSidesAskForAnotherBefore) {
  constexpr std::uint64_t kMost = 100;
  for (const Cipher cipher : ciphers()) {
    const bool is_aes = cipher == Cipher::kAesGcm;
    Session vehicle(kBorn, Session::Role::kInitiator, 22, keys_of(1, cipher), kMost);
    Session road(kBorn, Session::Role::kResponder, 11, keys_of(1, cipher), kMost);
    for (std::uint64_t i = 1; i <= kMost; ++i) {
      // A path that was taken away and comes back leaves out as many numbers as it likes.
      Bytes packet = probe(i * Session::kMostPackets);
      ASSERT_TRUE(vehicle.seal(packet));
      EXPECT_EQ(open(road, packet), Opened::kOk);
      EXPECT_EQ(vehicle.wants_rekey(), is_aes && i >= kMost / 2);
      EXPECT_EQ(road.wants_rekey(), is_aes && i >= kMost / 2);
    }
    Bytes beyond = probe(UINT64_MAX);
    EXPECT_EQ(vehicle.seal(beyond), !is_aes);
    // Each path has keys of its own.
    Bytes elsewhere = probe(5, 4);
    EXPECT_TRUE(vehicle.seal(elsewhere));
  }
}

TEST(Session, SealsNoNumberTwiceWhateverIsAsked) {
  Both b;
  Bytes packet = probe(5);
  ASSERT_TRUE(b.vehicle.seal(packet));
  for (const std::uint64_t number : {5U, 4U, 1U}) {
    Bytes again = probe(number);
    EXPECT_FALSE(b.vehicle.seal(again)) << number;
  }
  Bytes next = probe(6);
  EXPECT_TRUE(b.vehicle.seal(next));
  Bytes elsewhere = probe(5, 4);
  EXPECT_TRUE(b.vehicle.seal(elsewhere));
}

TEST(Session, ChallengesHaveNumbersOfTheirOwn) {
  for (const Cipher cipher : ciphers()) {
    Both b{cipher};
    for (int i = 0; i < 3; ++i) {
      Bytes challenge = probe(5, 3, 100, wire::PacketType::kChallenge);
      ASSERT_TRUE(b.road.seal(challenge));
      EXPECT_EQ(wire::peek(challenge)->number, static_cast<std::uint64_t>(i + 1));
      EXPECT_EQ(open(b.vehicle, challenge), Opened::kOk);
      EXPECT_EQ(open(b.vehicle, challenge), Opened::kReplayed);
    }
    Bytes data = probe(1, 3);
    ASSERT_TRUE(b.road.seal(data));
    EXPECT_EQ(open(b.vehicle, data), Opened::kOk);
  }
}

TEST(Session, PathsBeyondItsRoomWaitForTheNextOne) {
  Both b;
  for (std::uint16_t path = 0; path < Session::kMaxPaths; ++path) {
    EXPECT_EQ(b.vehicle.wants_rekey(), path + 1U >= Session::kMaxPaths);
    Bytes packet = probe(1, path);
    ASSERT_TRUE(b.vehicle.seal(packet));
    EXPECT_EQ(open(b.road, packet), Opened::kOk);
  }
  Bytes more = probe(1, 1000);
  EXPECT_FALSE(b.vehicle.seal(more));
  Bytes challenge = probe(5, 1000, 100, wire::PacketType::kChallenge);
  EXPECT_TRUE(b.vehicle.seal(challenge));
  EXPECT_EQ(open(b.road, challenge), Opened::kOk);
}

TEST(Session, TheLargestNumberBlocksNobodyElse) {
  Both b;
  Bytes last = probe(UINT64_MAX, 3);
  ASSERT_TRUE(b.vehicle.seal(last));
  EXPECT_EQ(open(b.road, last), Opened::kOk);
  EXPECT_EQ(open(b.road, last), Opened::kReplayed);
  // Nothing is left on this path, and nothing was used twice.
  Bytes again = probe(UINT64_MAX, 3);
  EXPECT_FALSE(b.vehicle.seal(again));
  Bytes other = probe(1, 4);
  EXPECT_TRUE(b.vehicle.seal(other));
}

RC_GTEST_PROP(Session, AnyBytesAreForged, (const std::vector<std::uint8_t>& bytes)) {
  Both b;
  Bytes packet(bytes.size());
  std::ranges::transform(bytes, packet.begin(), [](std::uint8_t v) { return std::byte{v}; });
  RC_ASSERT(open(b.road, packet) == Opened::kForged);
}

}  // namespace
}  // namespace interneuron::crypto::session_test
