// Who gets a session: the two sides of a handshake, and everybody who would like to be one.
#include <gtest/gtest.h>

#include "core/secure/entropy.h"
#include "core/secure/handshake.h"
#include "core/secure/responder.h"
#include "lab/sim/trust.h"

namespace interneuron::crypto::handshake_test {
namespace {

using namespace std::chrono_literals;
using Verdict = Responder::Verdict;

constexpr LinkId kNic{1};

Address address(std::uint8_t host) {
  Address a{.size = 16};
  a.raw[4] = std::byte{10};
  a.raw[7] = std::byte{host};
  return a;
}

struct Bench {
  TimePoint now{1h};
  KeyPair vehicle_key = key_pair_of(sim::secret_key(1));
  KeyPair road_key = key_pair_of(sim::secret_key(2));
  Initiator vehicle{vehicle_key, {road_key.open, sim::secret_key(5)}, SessionId{100}};
  Security security{.key = sim::secret_key(2), .peers = {{vehicle_key.open, sim::secret_key(5)}}};
  Trust trust{security};
  Responder road{road_key, SessionId{200}, trust};
  Entropy entropy{sim::secret_key(9)};
  std::uint32_t next_index = 1;
  std::int64_t clock = 1'000'000;
  // What the two say that they can.
  Ciphers of_vehicle = 0;
  Ciphers of_road = 0;

  Initiator::Fresh fresh(Ciphers ciphers = 0) {
    return {next_index++, entropy.draw_key(), ++clock, 0, ciphers};
  }
  Bytes initiation(std::uint16_t path = 0) {
    Bytes out(kInitiationBytes);
    vehicle.begin(now);
    if (vehicle.needs_message(now)) {
      EXPECT_TRUE(vehicle.make_message(now, fresh(of_vehicle)));
    }
    vehicle.write(LinkId{path}, out);
    return out;
  }
  Datagram datagram(const Bytes& bytes, std::uint8_t host = 1) const {
    return {kNic, address(host), bytes};
  }
  Verdict take(const Bytes& bytes, std::uint8_t host = 1) {
    const auto header = wire::peek(bytes);
    return header ? road.take(now, *header, datagram(bytes, host), entropy) : Verdict::kRefused;
  }
  std::optional<Responder::Accepted> accept(const Bytes& bytes, std::uint8_t host = 1) {
    return road.accept(now, *wire::peek(bytes), datagram(bytes, host), fresh(of_road));
  }
  Bytes answer() {
    Bytes out(kMaxDatagramBytes);
    EXPECT_TRUE(road.next());
    if (road.next()) out.resize(road.write(out, wire::Token{std::byte{42}}));
    return out;
  }
};

TEST(Handshake, BothSidesHaveTheSameKeysAndKnowEachOther) {
  Bench b;
  const Bytes asked = b.initiation(3);
  ASSERT_EQ(b.take(asked), Verdict::kNew);
  const auto accepted = b.accept(asked);
  ASSERT_TRUE(accepted);
  EXPECT_EQ(accepted->who, b.vehicle_key.open);
  EXPECT_EQ(accepted->theirs.life, SessionId{100});
  EXPECT_EQ(b.road.next()->path, LinkId{3});
  EXPECT_EQ(b.road.next()->to, address(1));
  const Bytes told = b.answer();
  const auto answer = b.vehicle.take_response(told);
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->theirs.life, SessionId{200});
  EXPECT_EQ(answer->keys.from_initiator, accepted->keys.from_initiator);
  EXPECT_EQ(answer->keys.from_responder, accepted->keys.from_responder);
  EXPECT_EQ(b.vehicle.token_of(told), wire::Token{std::byte{42}});
  EXPECT_FALSE(b.vehicle.is_trying());
}

TEST(Handshake, CopiesOverOtherPathsAreAnsweredOnceEach) {
  Bench b;
  const Bytes first = b.initiation(0);
  const Bytes second = b.initiation(1);
  ASSERT_EQ(b.take(first), Verdict::kNew);
  ASSERT_TRUE(b.accept(first));
  EXPECT_EQ(b.take(second, 2), Verdict::kAnswered);
  const Bytes to_first = b.answer();
  EXPECT_EQ(b.road.next()->to, address(2));
  const Bytes to_second = b.answer();
  ASSERT_TRUE(b.vehicle.take_response(to_second));
  EXPECT_TRUE(b.vehicle.token_of(to_first));
  // The same again, from wherever, is answered by nobody.
  for (const Bytes& copy : {first, second}) {
    EXPECT_EQ(b.take(copy, 66), Verdict::kRefused);
    EXPECT_FALSE(b.road.next());
  }
}

TEST(Handshake, AnotherTryOfTheSameMessageIsAnsweredAgain) {
  Bench b;
  const Bytes first = b.initiation();
  ASSERT_EQ(b.take(first), Verdict::kNew);
  ASSERT_TRUE(b.accept(first));
  b.answer();
  b.vehicle.tried(b.now);
  b.now += 100ms;
  const Bytes again = b.initiation();
  EXPECT_EQ(b.take(again), Verdict::kAnswered);
  EXPECT_TRUE(b.vehicle.take_response(b.answer()));
}

TEST(Handshake, WhatWasRecordedIsRefusedForEver) {
  Bench b;
  const Bytes asked = b.initiation();
  ASSERT_EQ(b.take(asked), Verdict::kNew);
  ASSERT_TRUE(b.accept(asked));
  b.answer();
  for (const Duration later : {1s, 10s, 10'000s}) {
    b.now += later;
    if (b.take(asked) == Verdict::kNew) {
      EXPECT_FALSE(b.accept(asked));
    }
    EXPECT_FALSE(b.road.next());
  }
}

TEST(Handshake, NothingOfAnInitiationMayBeChanged) {
  Bench b;
  const Bytes asked = b.initiation();
  for (std::size_t bit = 0; bit < 8 * asked.size(); ++bit) {
    Bytes changed = asked;
    changed[bit / 8] ^= std::byte{1} << bit % 8;
    b.now += 1s;
    // mac2 is only looked at under load.
    if (bit / 8 >= asked.size() - kMacBytes) continue;
    EXPECT_EQ(b.take(changed), Verdict::kRefused) << bit;
  }
  // Also not by who knows the public key, and so can make another mac1.
  for (std::size_t byte = wire::kHeaderBytes; byte < asked.size() - 2 * kMacBytes; ++byte) {
    Bytes changed = asked;
    changed[byte] ^= std::byte{1};
    const InitiationParts parts = parts_of_initiation(changed);
    std::ranges::copy(mac_of(mac1_key(b.road_key.open), parts.before_mac1),
                      changed.begin() + (parts.mac1.data() - changed.data()));
    b.now += 1s;
    if (b.take(changed) == Verdict::kNew) {
      EXPECT_FALSE(b.accept(changed)) << byte;
    }
    EXPECT_FALSE(b.road.next());
  }
  for (std::size_t size = 0; size < asked.size(); ++size) {
    EXPECT_EQ(b.take(Bytes(asked.begin(), asked.begin() + static_cast<std::ptrdiff_t>(size))),
              Verdict::kRefused);
  }
  b.now += 1s;
  ASSERT_EQ(b.take(asked), Verdict::kNew);
  EXPECT_TRUE(b.accept(asked));
}

// Whoever is on one path sees the ephemeral key before the copies over the others have come.
TEST(Handshake, WhoRepeatsAnEphemeralKeyKeepsItsOwnerNotOut) {
  Bench b;
  const Bytes asked = b.initiation();
  Initiator stranger(key_pair_of(sim::secret_key(77)), {b.road_key.open, {}}, SessionId{100});
  stranger.begin(b.now);
  ASSERT_TRUE(stranger.make_message(b.now, b.fresh()));
  Bytes forged(kInitiationBytes);
  stranger.write(LinkId{0}, forged);
  std::copy_n(asked.begin() + wire::kHeaderBytes, kKeyBytes, forged.begin() + wire::kHeaderBytes);
  const InitiationParts parts = parts_of_initiation(forged);
  std::ranges::copy(mac_of(mac1_key(b.road_key.open), parts.before_mac1),
                    forged.begin() + (parts.mac1.data() - forged.data()));
  ASSERT_EQ(b.take(forged), Verdict::kNew);
  EXPECT_FALSE(b.accept(forged));
  ASSERT_EQ(b.take(asked), Verdict::kNew);
  EXPECT_TRUE(b.accept(asked));
}

TEST(Handshake, NothingOfAResponseMayBeChanged) {
  Bench b;
  const Bytes asked = b.initiation();
  ASSERT_EQ(b.take(asked), Verdict::kNew);
  ASSERT_TRUE(b.accept(asked));
  const Bytes told = b.answer();
  for (std::size_t bit = 0; bit < 8 * told.size(); ++bit) {
    Bytes changed = told;
    changed[bit / 8] ^= std::byte{1} << bit % 8;
    EXPECT_FALSE(b.vehicle.take_response(changed)) << bit;
  }
  EXPECT_TRUE(b.vehicle.take_response(told));
}

TEST(Handshake, TheyTakeTheBestCipherThatBothHave) {
  // Bits that nobody knows yet are of no account.
  constexpr std::array<Ciphers, 4> kAny{0x00, 0x01, 0xfe, 0xff};
  for (const Ciphers vehicle : kAny) {
    for (const Ciphers road : kAny) {
      Bench b;
      b.of_vehicle = vehicle;
      b.of_road = road;
      const Bytes asked = b.initiation();
      ASSERT_EQ(b.take(asked), Verdict::kNew);
      const auto accepted = b.accept(asked);
      const auto answer = b.vehicle.take_response(b.answer());
      ASSERT_TRUE(accepted && answer);
      const bool is_aes = (vehicle & 1) != 0 && (road & 1) != 0;
      EXPECT_EQ(accepted->keys.cipher, is_aes ? Cipher::kAesGcm : Cipher::kChaChaPoly);
      EXPECT_EQ(answer->keys.cipher, accepted->keys.cipher);
    }
  }
}

// What is said of ciphers is the last byte of either hello. A key stream is added to it, so whoever
// is on the path can turn its bit without being able to read it, and make mac1 anew.
TEST(Handshake, NobodyOnThePathTalksTwoHostsDown) {
  Bench b;
  b.of_vehicle = b.of_road = kHasAesGcm;
  const Bytes asked = b.initiation();
  Bytes stripped = asked;
  InitiationParts parts = parts_of_initiation(stripped);
  stripped[wire::kHeaderBytes + parts.noise.size() - kAeadTagBytes - 1] ^= std::byte{kHasAesGcm};
  parts = parts_of_initiation(stripped);
  std::ranges::copy(mac_of(mac1_key(b.road_key.open), parts.before_mac1),
                    stripped.begin() + (parts.mac1.data() - stripped.data()));
  ASSERT_EQ(b.take(stripped), Verdict::kNew);
  EXPECT_FALSE(b.accept(stripped));
  EXPECT_FALSE(b.road.next());
  // Nor by taking the byte away, as hosts without ciphers to choose from say hello.
  Bytes shorter = asked;
  const std::size_t last = wire::kHeaderBytes + parts.noise.size() - kAeadTagBytes - 1;
  shorter.erase(shorter.begin() + static_cast<std::ptrdiff_t>(last));
  EXPECT_EQ(b.take(shorter), Verdict::kRefused);

  ASSERT_EQ(b.take(asked), Verdict::kNew);
  ASSERT_TRUE(b.accept(asked));
  const Bytes told = b.answer();
  Bytes changed = told;
  changed[wire::kHeaderBytes + parts_of_response(told).noise.size() - kAeadTagBytes - 1] ^=
      std::byte{kHasAesGcm};
  EXPECT_FALSE(b.vehicle.take_response(changed));
  const auto answer = b.vehicle.take_response(told);
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->keys.cipher, Cipher::kAesGcm);
}

TEST(Handshake, WhoIsNotTrustedIsNotAnswered) {
  Bench b;
  b.vehicle = Initiator(key_pair_of(sim::secret_key(77)), {b.road_key.open, sim::secret_key(5)},
                        SessionId{100});
  const Bytes asked = b.initiation();
  ASSERT_EQ(b.take(asked), Verdict::kNew);
  EXPECT_FALSE(b.accept(asked));
  EXPECT_FALSE(b.road.next());
}

TEST(Handshake, WhoDoesNotShareTheKeyGetsNoSession) {
  Bench b;
  b.vehicle = Initiator(b.vehicle_key, {b.road_key.open, sim::secret_key(6)}, SessionId{100});
  const Bytes asked = b.initiation();
  ASSERT_EQ(b.take(asked), Verdict::kNew);
  ASSERT_TRUE(b.accept(asked));
  EXPECT_FALSE(b.vehicle.take_response(b.answer()));
}

// What a host that is trusted says of itself is within bounds, so that whoever counts on from a
// time does not overflow.
TEST(Handshake, TimesBeyondAllBoundsAreRefused) {
  for (const std::int64_t time : {INT64_MIN, std::int64_t{-1}, kLatestUnixNs + 1, INT64_MAX}) {
    Bench b;
    const auto fresh = [&b, time] {
      return Initiator::Fresh{b.next_index++, b.entropy.draw_key(), time};
    };
    b.vehicle.begin(b.now);
    ASSERT_TRUE(b.vehicle.make_message(b.now, fresh()));
    const Bytes asked = b.initiation();
    ASSERT_EQ(b.take(asked), Verdict::kNew);
    EXPECT_FALSE(b.accept(asked)) << time;
    Bench other;
    const Bytes asks = other.initiation();
    ASSERT_EQ(other.take(asks), Verdict::kNew);
    ASSERT_TRUE(other.road.accept(other.now, *wire::peek(asks), other.datagram(asks), fresh()));
    EXPECT_FALSE(other.vehicle.take_response(other.answer())) << time;
  }
}

// Under load a responder takes a part of what comes: tries come often at first, and a cookie is
// used at once, but once for each message, since whoever is on the path can make one.
TEST(Handshake, TriesComeOftenAtFirstAndACookieIsUsedAtOnce) {
  Bench b;
  b.vehicle.begin(b.now);
  std::vector<int> tries;
  for (int ms = 0; ms <= 20'000; ++ms) {
    const TimePoint now = b.now + std::chrono::milliseconds(ms);
    if (!b.vehicle.is_due(now)) continue;
    tries.push_back(ms);
    b.vehicle.tried(now);
  }
  EXPECT_EQ(tries, (std::vector<int>{0, 100, 300, 500, 700, 900, 1100, 1300, 1500, 1700, 1900, 2100,
                                     2300, 2700, 3500, 5100, 8300, 13300, 18300}));
}

// Takes all answers that are given freely.
void flood(Bench& b) {
  for (std::uint32_t i = 0; i <= Responder::kFreely; ++i) {
    b.vehicle.stop();
    b.take(b.initiation());
  }
  while (b.road.next()) b.answer();
}

TEST(Handshake, UnderLoadWhoeverReceivesAtHisAddressIsServed) {
  Bench b;
  flood(b);
  b.vehicle.stop();
  ASSERT_EQ(b.take(b.initiation()), Verdict::kAnswered);
  EXPECT_EQ(b.road.next()->index, 0U);
  const Bytes cookie = b.answer();
  ASSERT_EQ(cookie.size(), kCookieBytes);
  for (std::size_t bit = 0; bit < 8 * cookie.size(); ++bit) {
    Bytes changed = cookie;
    changed[bit / 8] ^= std::byte{1} << bit % 8;
    const auto header = wire::peek(changed);
    // The path, the session and the number in the header say what is answered.
    const bool is_bound = bit / 8 >= 2 && (bit / 8 < 16 || bit / 8 >= wire::kHeaderBytes);
    if (is_bound && header) {
      EXPECT_FALSE(b.vehicle.take_cookie(b.now, *header, changed)) << bit;
    }
  }
  b.vehicle.tried(b.now);
  EXPECT_FALSE(b.vehicle.is_due(b.now));
  ASSERT_TRUE(b.vehicle.take_cookie(b.now, *wire::peek(cookie), cookie));
  EXPECT_TRUE(b.vehicle.is_due(b.now));
  b.vehicle.tried(b.now);
  ASSERT_TRUE(b.vehicle.take_cookie(b.now, *wire::peek(cookie), cookie));
  EXPECT_FALSE(b.vehicle.is_due(b.now));
  const Bytes again = b.initiation();
  // From elsewhere it proves nothing.
  EXPECT_EQ(b.take(again, 66), Verdict::kAnswered);
  EXPECT_EQ(b.road.next()->index, 0U);
  b.answer();
  ASSERT_EQ(b.take(again), Verdict::kNew);
  ASSERT_TRUE(b.accept(again));
  EXPECT_TRUE(b.vehicle.take_response(b.answer()));
}

TEST(Handshake, OneHostTakesNotAllAnswersUnderLoad) {
  Bench b;
  flood(b);
  b.vehicle.stop();
  b.take(b.initiation());
  const Bytes cookie = b.answer();
  ASSERT_TRUE(b.vehicle.take_cookie(b.now, *wire::peek(cookie), cookie));
  int served = 0;
  for (int i = 0; i < 100; ++i) {
    b.vehicle.tried(b.now);
    served += b.take(b.initiation()) == Verdict::kNew ? 1 : 0;
    while (b.road.next()) b.answer();
  }
  EXPECT_LE(served, Responder::kSourceBurst);
  EXPECT_GE(served, 1);
}

TEST(Handshake, WhatWaitsIsBounded) {
  Bench b;
  flood(b);
  for (int i = 0; i < 2000; ++i) {
    b.vehicle.stop();
    b.take(b.initiation(), static_cast<std::uint8_t>(i));
  }
  std::size_t waiting = 0;
  for (; b.road.next(); ++waiting) b.answer();
  EXPECT_LE(waiting, Responder::kMaxWaiting);
}

}  // namespace
}  // namespace interneuron::crypto::handshake_test
