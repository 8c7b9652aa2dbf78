// docs/wire_format.md is the authority: its handshake with fixed keys is the one that is held here,
// byte for byte.
#include "tests/core/wire/document.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sodium.h>

#include <iterator>

#include "core/secure/bytes.h"
#include "core/secure/cookie.h"
#include "core/secure/handshake.h"
#include "core/secure/responder.h"
#include "lab/sim/trust.h"

namespace interneuron::crypto::document_test {
namespace {

constexpr LinkId kPath{2};
constexpr std::int64_t kVehicleTime = 1'700'000'000'000'000'000;
constexpr std::int64_t kRoadTime = 1'700'000'000'020'000'000;
constexpr std::uint32_t kVehicleIndex = 0xa1a1a1a1;
constexpr std::uint32_t kRoadIndex = 0xb2b2b2b2;
constexpr TimePoint kBorn{std::chrono::hours(1)};

std::string hex(std::span<const std::byte> bytes) {
  std::string out(2 * bytes.size() + 1, '\0');
  sodium_bin2hex(out.data(), out.size(), raw(bytes), bytes.size());
  out.pop_back();
  return out;
}

// The handshake of the document.
struct Example {
  KeyPair vehicle_key = key_pair_of(sim::secret_key(1));
  KeyPair road_key = key_pair_of(sim::secret_key(2));
  Security security{.key = sim::secret_key(2), .peers = {{vehicle_key.open, sim::secret_key(5)}}};
  Trust trust{security};
  Initiator vehicle{vehicle_key, {road_key.open, sim::secret_key(5)}, SessionId{0x5eed0001}};
  Responder road{road_key, SessionId{0xcafe0002}, trust};
  Bytes initiation = Bytes(kInitiationBytes);
  Bytes response = Bytes(kResponseBytes);
  Bytes cookie = Bytes(kCookieBytes);
  Bytes sealed;
  std::optional<Responder::Accepted> accepted;

  Example() {
    Entropy entropy(sim::secret_key(9));
    vehicle.begin(kBorn);
    EXPECT_TRUE(vehicle.make_message(
        kBorn, {kVehicleIndex, sim::secret_key(3), kVehicleTime, 0, kHasAesGcm}));
    vehicle.write(kPath, initiation);
    const auto header = wire::peek(initiation);
    SecretKey given;
    std::ranges::copy(wire::example_token(), given.writable().begin());
    write_cookie(cookie, *header, parts_of_initiation(initiation).mac1, cookie_key(road_key.open),
                 given, sim::secret_key(6));
    const Datagram datagram{LinkId{1}, {}, initiation};
    EXPECT_EQ(road.take(kBorn, *header, datagram, entropy), Responder::Verdict::kNew);
    accepted = road.accept(kBorn, *header, datagram, {kRoadIndex, sim::secret_key(4), kRoadTime});
    EXPECT_TRUE(accepted);
    EXPECT_EQ(road.write(response, wire::example_token()), kResponseBytes);
    sealed = seal(accepted->keys);
  }

  static Bytes seal(const Split& keys) {
    Bytes out = wire::from_hex(wire::kPlainExample);
    Session session(kBorn, Session::Role::kInitiator, kRoadIndex, keys);
    EXPECT_TRUE(session.seal(out));
    return out;
  }
  // As it is sealed where the road, too, says that it has AES-256-GCM: nothing where it has not.
  Bytes sealed_by_aes() const {
    if (ciphers_here() == 0) return {};
    Split keys = accepted->keys;
    keys.cipher = Cipher::kAesGcm;
    return seal(keys);
  }
};

TEST(SecureDocument, ShowsAHandshakeAndWhatItProtects) {
  const Example e;
  std::vector<Bytes> shown = wire::examples_of_the_document();
  ASSERT_GE(shown.size(), wire::kClearExamples);
  shown.erase(shown.begin(), shown.begin() + wire::kClearExamples);
  const Bytes by_aes = e.sealed_by_aes();
  ASSERT_FALSE(shown.empty());
  if (by_aes.empty()) shown.back().clear();
  EXPECT_EQ(shown, (std::vector<Bytes>{e.initiation, e.cookie, e.response, e.sealed, by_aes}))
      << hex(e.initiation) << "\n"
      << hex(e.cookie) << "\n"
      << hex(e.response) << "\n"
      << hex(e.sealed) << "\n"
      << hex(by_aes);
}

TEST(SecureDocument, NamesTheKeysOfItsHandshake) {
  const Example e;
  std::ifstream in(places::source() + "/docs/wire_format.md");
  const std::string text{std::istreambuf_iterator<char>(in), {}};
  for (const std::string& key :
       {hex(e.vehicle_key.open), hex(e.road_key.open), hex(e.accepted->keys.from_initiator.bytes()),
        hex(e.accepted->keys.from_responder.bytes())}) {
    EXPECT_THAT(text, testing::HasSubstr("`" + key + "`"));
  }
}

TEST(SecureDocument, ItsExamplesAreTakenByTheOtherSide) {
  Example e;
  const auto header = wire::peek(e.cookie);
  EXPECT_TRUE(e.vehicle.take_cookie(kBorn, *header, e.cookie));
  const auto answer = e.vehicle.take_response(e.response);
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->theirs.life, SessionId{0xcafe0002});
  EXPECT_EQ(answer->theirs.unix_ns, kRoadTime);
  EXPECT_EQ(e.vehicle.token_of(e.response), wire::example_token());
  Session road(kBorn, Session::Role::kResponder, kVehicleIndex, e.accepted->keys);
  Bytes opened(e.sealed.size());
  ASSERT_EQ(road.open(*wire::peek(e.sealed), e.sealed, opened), Session::Opened::kOk);
  const Bytes clear = wire::from_hex(wire::kPlainExample);
  EXPECT_TRUE(std::ranges::equal(
      std::span(opened).subspan(wire::kAssociatedBytes, clear.size() - 2 * wire::kTagBytes),
      std::span(clear).subspan(wire::kAssociatedBytes, clear.size() - 2 * wire::kTagBytes)));
}

}  // namespace
}  // namespace interneuron::crypto::document_test
