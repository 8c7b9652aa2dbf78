// --key, --peer-key, --trust and --insecure, and what becomes of them.
#include "host/settings/key_options.h"

#include <gmock/gmock.h>

#include <fstream>

#include "host/io/steady_clock.h"
#include "host/process/failure.h"
#include "tests/app/cli/support.h"
#include "tests/trust.h"

namespace interneuron::cli {
namespace {

using testing::HasSubstr;

std::string text_of(int host) { return to_base64(key_of_host(host)); }

class KeyOptionsTest : public testing::Test {
 protected:
  KeyOptionsTest() { write_new_key(own(), secret_key(1)); }
  std::string own() const { return folder_ / "own"; }
  std::string shared() const { return folder_ / "shared"; }
  // What the options are refused with; the code in front.
  static std::string problem_of(const KeyOptions& options, Trusts trusts) {
    try {
      const Credentials credentials(options, trusts);
    } catch (const Failure& failure) {
      EXPECT_EQ(std::string(failure.what()).find('\n'), std::string::npos);
      return std::to_string(failure.code()) + " " + failure.what();
    }
    return "";
  }
  TempFolder folder_;
};

TEST_F(KeyOptionsTest, AKeyMayHaveASharedOneBehindIt) {
  EXPECT_EQ(parse_trust_option(text_of(2)).key, key_of_host(2));
  EXPECT_EQ(parse_trust_option(text_of(2)).psk_file, "");
  EXPECT_EQ(parse_trust_option(text_of(2) + ",psk=a,b c").psk_file, "a,b c");
  for (const std::string& text :
       {std::string(), std::string("x"), text_of(2).substr(1), text_of(2) + ",",
        text_of(2) + ",psk=", text_of(2) + ",key=a", text_of(2) + "\n", "," + text_of(2)}) {
    EXPECT_THROW(parse_trust_option(text), Failure) << text;
  }
}

TEST_F(KeyOptionsTest, TheNodeGetsTheKeys) {
  write_new_key(shared(), secret_key(9));
  const Credentials credentials(
      {.key = own(), .trusted = {text_of(2), text_of(3) + ",psk=" + shared()}}, Trusts::kMany);
  NodeOptions node;
  credentials.apply(node);
  EXPECT_FALSE(node.insecure);
  ASSERT_TRUE(node.security);
  EXPECT_EQ(node.security->key, secret_key(1));
  ASSERT_EQ(node.security->peers.size(), 2U);
  EXPECT_EQ(node.security->peers[0].shared, SecretKey{});
  EXPECT_EQ(node.security->peers[1].key, key_of_host(3));
  EXPECT_EQ(node.security->peers[1].shared, secret_key(9));
  EXPECT_EQ(node.security->seed, SecretKey{}) << "the node draws it";
  EXPECT_THAT(credentials.warnings(), testing::IsEmpty());
  ASSERT_NE(credentials.time_file(), nullptr);
}

TEST_F(KeyOptionsTest, TheTimeIsThatOfTheClockOrLaterIfSuchAOneIsStored) {
  const KeyOptions options{.key = own(), .trusted = {text_of(2)}};
  const auto time = [&options] {
    NodeOptions node;
    Credentials(options, Trusts::kThePeer).apply(node);
    return node.security->unix_time_ns;
  };
  const std::int64_t now = io::unix_time_ns();
  EXPECT_GE(time(), now);
  TimeFile(own()).store(1);
  EXPECT_GE(time(), now) << "a time of the past";
  const std::int64_t later = now + Duration(std::chrono::hours(1000)).count();
  TimeFile(own()).store(later);
  EXPECT_EQ(time(), later + 1) << "the clock went back";
  std::ofstream(own() + ".time") << "nonsense";
  EXPECT_LT(time(), later) << "nothing that counts";
  const auto told = Credentials(options, Trusts::kThePeer).warnings();
  ASSERT_EQ(told.size(), 1U);
  EXPECT_THAT(told[0], HasSubstr("own.time"));
}

TEST_F(KeyOptionsTest, WithoutKeysNothingIsEncryptedAndThatIsTold) {
  const Credentials credentials({.insecure = true}, Trusts::kMany);
  NodeOptions node;
  credentials.apply(node);
  EXPECT_TRUE(node.insecure);
  EXPECT_FALSE(node.security);
  EXPECT_EQ(credentials.time_file(), nullptr);
  ASSERT_EQ(credentials.warnings().size(), 1U);
  EXPECT_THAT(credentials.warnings()[0], HasSubstr("in the clear"));
}

TEST_F(KeyOptionsTest, WhatIsMissingOrContradictsItselfIsNamed) {
  EXPECT_THAT(problem_of({.key = own(), .insecure = true}, Trusts::kMany),
              HasSubstr("2 --insecure sends everything in the clear"));
  EXPECT_THAT(problem_of({.trusted = {text_of(2)}, .insecure = true}, Trusts::kThePeer),
              HasSubstr("--peer-key"));
  EXPECT_THAT(problem_of({.key = own()}, Trusts::kMany), HasSubstr("3 nobody is trusted"));
  EXPECT_THAT(problem_of({.key = own()}, Trusts::kThePeer), HasSubstr("3 the roadside unit's key"));
  EXPECT_THAT(problem_of({.key = own(), .trusted = {text_of(1)}}, Trusts::kMany),
              HasSubstr("3 --trust " + text_of(1) + " is this host's own key"));
  EXPECT_THAT(
      problem_of({.key = own(), .trusted = {text_of(2) + ",psk=" + shared()}}, Trusts::kMany),
      HasSubstr("3 '" + shared() + "' is not there"));
}

TEST_F(KeyOptionsTest, TheCommandLineHasThem) {
  CLI::App road{"test", "road"};
  KeyOptions options;
  add_key_options(road, options, Trusts::kMany);
  EXPECT_FALSE(is_given(options));
  road.parse("--key k --trust " + text_of(2) + " --trust " + text_of(3) + ",psk=f", false);
  EXPECT_TRUE(is_given(options));
  EXPECT_EQ(options.key, "k");
  EXPECT_EQ(options.trusted, (std::vector<std::string>{text_of(2), text_of(3) + ",psk=f"}));
  CLI::App vehicle{"test", "vehicle"};
  KeyOptions others;
  add_key_options(vehicle, others, Trusts::kThePeer);
  vehicle.parse("--peer-key " + text_of(2), false);
  EXPECT_EQ(others.trusted, (std::vector<std::string>{text_of(2)}));
  EXPECT_THROW(vehicle.parse("--peer-key nonsense", false), CLI::ValidationError);
}

}  // namespace
}  // namespace interneuron::cli
