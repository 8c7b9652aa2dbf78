#include <gtest/gtest.h>

#include "core/secure/entropy.h"
#include "interneuron/security.h"
#include "lab/sim/trust.h"

namespace interneuron::keys_test {
namespace {

TEST(Keys, AreCopiedAsBase64) {
  const PublicKey key = public_key_of(sim::secret_key(1));
  const std::string text = to_base64(key);
  EXPECT_EQ(text.size(), 44U);
  EXPECT_EQ(parse_key(text), key);
  for (const std::string& wrong : {std::string(), text + "=", text.substr(0, 43), " " + text,
                                   text.substr(1), std::string(44, '!'), std::string(200, 'A')}) {
    EXPECT_EQ(parse_key(wrong), std::nullopt) << wrong;
  }
}

TEST(Keys, AreComparedByTheirBytes) {
  EXPECT_EQ(sim::secret_key(1), sim::secret_key(1));
  EXPECT_FALSE(sim::secret_key(1) == sim::secret_key(2));
  EXPECT_EQ(SecretKey{}, sim::secret_key(0));
}

TEST(Entropy, NeverGivesTheSameTwiceAndTheSameSeedTheSame) {
  crypto::Entropy a(sim::secret_key(1));
  crypto::Entropy b(sim::secret_key(1));
  crypto::Entropy c(sim::secret_key(2));
  std::vector<SecretKey> seen;
  for (int i = 0; i < 100; ++i) {
    const SecretKey key = a.draw_key();
    EXPECT_EQ(key, b.draw_key());
    for (const SecretKey& before : seen) EXPECT_FALSE(key == before);
    EXPECT_FALSE(key == c.draw_key());
    seen.push_back(key);
  }
  for (int i = 0; i < 1000; ++i) {
    EXPECT_LT(a.draw_below(10), 10U);
    EXPECT_NE(a.draw_index(), 0U);
  }
}

}  // namespace
}  // namespace interneuron::keys_test
