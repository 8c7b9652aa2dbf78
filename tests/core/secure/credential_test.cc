// What authorities sign, and whom it lets in.
#include "core/secure/credential.h"

#include <gtest/gtest.h>

#include "core/secure/trust.h"
#include "lab/sim/trust.h"

namespace interneuron::crypto::credential_test {
namespace {

const SecretKey kAuthority = sim::secret_key(50);
const SecretKey kNextAuthority = sim::secret_key(51);
constexpr std::int64_t kNow = 1'800'000'000;

Credential credential_of(int host) {
  return {sim::key_of_host(host), NodeRole::kVehicle, "truck 7", kNow - 10, kNow + 10};
}

Security security() {
  Security out = *sim::security_of(2, {1});
  out.authorities = {authority_key_of(kAuthority), authority_key_of(kNextAuthority)};
  return out;
}

TEST(Credential, IsOneLineOfTextForThoseWhoCopyIt) {
  const Bytes bytes = sign_credential(credential_of(3), kAuthority);
  const std::string text = to_text(bytes);
  EXPECT_EQ(text.size(), 172U);
  EXPECT_EQ(parse_text(text), bytes);
  EXPECT_EQ(parse_text(""), Bytes{});
  for (const std::string& wrong :
       {text.substr(1), text + "=", text + "\n", " " + text, "*" + text.substr(1)}) {
    EXPECT_FALSE(parse_text(wrong)) << wrong;
  }
  // Its owner reads it without the authority.
  ASSERT_TRUE(parse_credential(bytes));
  EXPECT_EQ(parse_credential(bytes)->node, "truck 7");
  EXPECT_FALSE(parse_credential(ByteView(bytes).first(bytes.size() - 1)));
}

TEST(Credential, IsReadAsItWasSigned) {
  const Bytes bytes = sign_credential(credential_of(3), kAuthority);
  EXPECT_EQ(bytes.size(), kCredentialBytes);
  const std::vector<PublicKey> authorities{authority_key_of(kAuthority)};
  const auto read = read_credential(bytes, authorities);
  ASSERT_TRUE(read);
  EXPECT_EQ(read->key, sim::key_of_host(3));
  EXPECT_EQ(read->node, "truck 7");
  EXPECT_EQ(read->role, NodeRole::kVehicle);
  EXPECT_EQ(read->not_after_s, kNow + 10);
  EXPECT_FALSE(read_credential(bytes, std::vector<PublicKey>{}));
  for (std::size_t bit = 0; bit < 8 * bytes.size(); bit += 3) {
    Bytes changed = bytes;
    changed[bit / 8] ^= std::byte{1} << bit % 8;
    EXPECT_FALSE(read_credential(changed, authorities)) << bit;
  }
}

TEST(Credential, OfTheOneAuthorityOrTheOtherLetsAVehicleInWhileItHolds) {
  const Trust trust(security());
  for (const SecretKey& by : {kAuthority, kNextAuthority}) {
    const Bytes shown = sign_credential(credential_of(3), by);
    EXPECT_TRUE(trust.may_join(sim::key_of_host(3), shown, kNow));
    EXPECT_FALSE(trust.may_join(sim::key_of_host(4), shown, kNow));
    EXPECT_FALSE(trust.may_join(sim::key_of_host(3), shown, kNow - 11));
    EXPECT_FALSE(trust.may_join(sim::key_of_host(3), shown, kNow + 10));
  }
  EXPECT_FALSE(trust.may_join(sim::key_of_host(3),
                              sign_credential(credential_of(3), sim::secret_key(9)), kNow));
  EXPECT_FALSE(trust.may_join(sim::key_of_host(3), {}, kNow));
  EXPECT_TRUE(trust.may_join(sim::key_of_host(1), {}, kNow));
  Credential road = credential_of(3);
  road.role = NodeRole::kRoadside;
  EXPECT_FALSE(trust.may_join(sim::key_of_host(3), sign_credential(road, kAuthority), kNow));
}

TEST(Revocations, CountForAllKeysAndOnlyNewerOnesAreTaken) {
  Trust trust(security());
  const Bytes shown = sign_credential(credential_of(3), kAuthority);
  const Bytes list =
      sign_revocations({kNow, {sim::key_of_host(3), sim::key_of_host(1)}}, kAuthority);
  EXPECT_FALSE(
      trust.take_revocations(sign_revocations({kNow, {sim::key_of_host(3)}}, sim::secret_key(9))));
  ASSERT_TRUE(trust.take_revocations(list));
  EXPECT_FALSE(trust.may_join(sim::key_of_host(3), shown, kNow));
  EXPECT_FALSE(trust.may_join(sim::key_of_host(1), {}, kNow));
  EXPECT_FALSE(trust.may_connect(sim::key_of_host(1)));
  EXPECT_FALSE(trust.take_revocations(list));
  EXPECT_FALSE(trust.take_revocations(sign_revocations({kNow - 1, {}}, kAuthority)));
  EXPECT_TRUE(trust.take_revocations(sign_revocations({kNow + 1, {}}, kAuthority)));
  EXPECT_TRUE(trust.may_join(sim::key_of_host(3), shown, kNow));
  EXPECT_EQ(trust.revocations_s(), kNow + 1);
}

TEST(Revocations, ThatAreOldFailAsTheOperatorSays) {
  const Bytes shown = sign_credential(credential_of(3), kAuthority);
  Security closed = security();
  closed.max_revocations_age_s = 5;
  closed.revocations = sign_revocations({kNow - 5, {}}, kAuthority);
  Security open = closed;
  open.stale_revocations = StaleRevocations::kAccept;
  EXPECT_TRUE(Trust(closed).may_join(sim::key_of_host(3), shown, kNow));
  EXPECT_FALSE(Trust(closed).may_join(sim::key_of_host(3), shown, kNow + 1));
  EXPECT_TRUE(Trust(closed).may_join(sim::key_of_host(1), {}, kNow + 1));
  EXPECT_TRUE(Trust(open).may_join(sim::key_of_host(3), shown, kNow + 1));
  closed.revocations.clear();
  EXPECT_FALSE(Trust(closed).may_join(sim::key_of_host(3), shown, kNow));
}

TEST(Revocations, AreReadFromAnyBytes) {
  const std::vector<PublicKey> authorities{authority_key_of(kAuthority)};
  const Bytes list = sign_revocations({kNow, {sim::key_of_host(3)}}, kAuthority);
  for (std::size_t size = 0; size < list.size(); ++size) {
    EXPECT_FALSE(read_revocations(std::span(list).first(size), authorities));
  }
  // A signature of a credential is none of a list.
  EXPECT_FALSE(read_revocations(sign_credential(credential_of(3), kAuthority), authorities));
  EXPECT_FALSE(read_revocations(Bytes(kMaxRevocationsBytes + 1), authorities));
}

TEST(Trust, RefusesWhatCannotBe) {
  Security s = security();
  s.authorities.push_back(sim::key_of_host(7));
  EXPECT_THROW(Trust{s}, std::invalid_argument);
  s = security();
  s.credential = Bytes(3);
  EXPECT_THROW(Trust{s}, std::invalid_argument);
  s = security();
  s.revocations = sign_revocations({kNow, {}}, sim::secret_key(9));
  EXPECT_THROW(Trust{s}, std::invalid_argument);
}

}  // namespace
}  // namespace interneuron::crypto::credential_test
