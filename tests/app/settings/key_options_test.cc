// --key, --peer-key, --trust and --insecure, and what becomes of them.
#include "app/settings/key_options.h"

#include <gmock/gmock.h>
#include <sys/stat.h>

#include <fstream>

#include "app/process/failure.h"
#include "core/secure/credential.h"
#include "lab/sim/trust.h"
#include "node/io/steady_clock.h"
#include "tests/app/cli/support.h"

namespace interneuron::settings::key_options_test {
namespace {

using testing::HasSubstr;

std::string text_of(int host) { return to_base64(sim::key_of_host(host)); }

class KeyOptionsTest : public testing::Test {
 protected:
  KeyOptionsTest() { write_new_key(own(), sim::secret_key(1)); }
  std::string own() const { return folder_ / "own"; }
  std::string shared() const { return folder_ / "shared"; }
  // What the options are refused with; the code in front.
  static std::string problem_of(const KeyOptions& options, Trusts trusts) {
    try {
      const Credentials credentials(options, trusts);
    } catch (const process::Failure& failure) {
      EXPECT_EQ(std::string(failure.what()).find('\n'), std::string::npos);
      return std::to_string(failure.code()) + " " + failure.what();
    }
    return "";
  }
  cli::TempFolder folder_;
};

TEST_F(KeyOptionsTest, AKeyMayHaveASharedOneBehindIt) {
  EXPECT_EQ(parse_trust_option(text_of(2)).key, sim::key_of_host(2));
  EXPECT_EQ(parse_trust_option(text_of(2)).psk_file, "");
  EXPECT_EQ(parse_trust_option(text_of(2) + ",psk=a,b c").psk_file, "a,b c");
  for (const std::string& text :
       {std::string(), std::string("x"), text_of(2).substr(1), text_of(2) + ",",
        text_of(2) + ",psk=", text_of(2) + ",key=a", text_of(2) + "\n", "," + text_of(2)}) {
    EXPECT_THROW(parse_trust_option(text), process::Failure) << text;
  }
}

TEST_F(KeyOptionsTest, TheNodeGetsTheKeys) {
  write_new_key(shared(), sim::secret_key(9));
  const Credentials credentials(
      {.key = own(), .trusted = {text_of(2), text_of(3) + ",psk=" + shared()}}, Trusts::kMany);
  NodeOptions node;
  credentials.apply(node);
  EXPECT_FALSE(node.insecure);
  ASSERT_TRUE(node.security);
  EXPECT_EQ(node.security->key, sim::secret_key(1));
  ASSERT_EQ(node.security->peers.size(), 2U);
  EXPECT_EQ(node.security->peers[0].shared, SecretKey{});
  EXPECT_EQ(node.security->peers[1].key, sim::key_of_host(3));
  EXPECT_EQ(node.security->peers[1].shared, sim::secret_key(9));
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

constexpr std::int64_t kForever = std::int64_t{1} << 40;
const SecretKey kAuthority = sim::secret_key(50);
const SecretKey kNext = sim::secret_key(51);

std::string authority_text(const SecretKey& authority) {
  return to_base64(crypto::authority_key_of(authority));
}

// What an authority says of this host's key.
Bytes signed_for(int host, const SecretKey& authority, std::int64_t until = kForever) {
  return crypto::sign_credential({sim::key_of_host(host), NodeRole::kVehicle, "bus7", 0, until},
                                 authority);
}

Bytes signed_list_of(std::int64_t issued_s, const SecretKey& authority) {
  return crypto::sign_revocations({issued_s, {sim::key_of_host(8)}}, authority);
}

TEST_F(KeyOptionsTest, TheNodeGetsWhatTheFleetHasSigned) {
  const std::string credential = folder_ / "credential";
  const std::string list = folder_ / "list";
  write_signed(credential, signed_for(1, kNext));
  write_signed(list, signed_list_of(1000, kAuthority));
  const KeyOptions options{.key = own(),
                           .trusted = {},
                           .authorities = {authority_text(kAuthority), authority_text(kNext)},
                           .credential = credential,
                           .revocations = list,
                           .revocations_max_age_days = 2,
                           .revocations_stale = "accept"};
  const Credentials credentials(options, Trusts::kMany);
  NodeOptions node;
  credentials.apply(node);
  ASSERT_TRUE(node.security);
  EXPECT_THAT(node.security->peers, testing::IsEmpty()) << "an authority is enough";
  EXPECT_EQ(node.security->authorities[1], crypto::authority_key_of(kNext));
  EXPECT_EQ(node.security->credential, signed_for(1, kNext));
  EXPECT_EQ(node.security->revocations, signed_list_of(1000, kAuthority));
  EXPECT_EQ(node.security->max_revocations_age_s, 2 * 86'400);
  EXPECT_EQ(node.security->stale_revocations, StaleRevocations::kAccept);
  EXPECT_THAT(credentials.warnings(), testing::IsEmpty());
  EXPECT_EQ(credentials.list_issued_s(), 1000);
  EXPECT_EQ(credentials.stale_list(1000, 1000 + 2 * 86'400), "");
  EXPECT_THAT(credentials.stale_list(1000, 1001 + 2 * 86'400), HasSubstr("revoked or not"));
}

TEST_F(KeyOptionsTest, FilesThatTheFleetHasNotSignedAreRefused) {
  const std::string file = folder_ / "signed";
  const auto problem = [&](bool list) {
    KeyOptions options{
        .key = own(), .trusted = {text_of(2)}, .authorities = {authority_text(kAuthority)}};
    (list ? options.revocations : options.credential) = file;
    return problem_of(options, Trusts::kThePeer);
  };
  EXPECT_THAT(problem(false), HasSubstr("3 '" + file + "' is not there"));
  EXPECT_EQ(problem(true), "") << "none has come yet";
  for (const std::string& text :
       {std::string(), std::string("x"), std::string(200'000, 'A'), authority_text(kAuthority)}) {
    std::ofstream(file) << text;
    for (const bool list : {false, true}) {
      EXPECT_THAT(problem(list), HasSubstr("3 '" + file + "' holds nothing"));
    }
  }
  write_signed(file, signed_for(1, kNext));
  EXPECT_THAT(problem(false), HasSubstr("no credential that one of --authority"));
  EXPECT_THAT(problem(true), HasSubstr("no list of revocations that one of --authority"));
  write_signed(file, signed_for(3, kAuthority));
  EXPECT_THAT(problem(false), HasSubstr("is the credential of " + text_of(3)));
  write_signed(file, signed_list_of(1000, kAuthority));
  EXPECT_THAT(problem(false), HasSubstr("holds no credential"));
  EXPECT_EQ(problem(true), "");
  ASSERT_EQ(::chmod(file.c_str(), 0666), 0);
  EXPECT_THAT(problem(true), HasSubstr("can be written by others"));
}

TEST_F(KeyOptionsTest, ACredentialThatHasEndedIsTold) {
  const std::string file = folder_ / "credential";
  write_signed(file, signed_for(1, kAuthority, 1000));
  const auto told =
      Credentials({.key = own(), .trusted = {text_of(2)}, .credential = file}, Trusts::kThePeer)
          .warnings();
  ASSERT_EQ(told.size(), 1U);
  EXPECT_THAT(told[0], HasSubstr("has ended at 1970-01-01T00:16:40Z"));
}

TEST_F(KeyOptionsTest, OnlyANewerListTakesThePlaceOfTheOneThatIsKept) {
  const std::string file = folder_ / "list";
  const std::vector<PublicKey> authorities{crypto::authority_key_of(kAuthority)};
  const RevocationsFile kept(file, authorities);
  EXPECT_EQ(kept.issued_s(), 0);
  const auto stored = [&] { return RevocationsFile(file, authorities).issued_s(); };
  const mode_t before = ::umask(0);
  EXPECT_EQ(kept.store(signed_list_of(1000, kAuthority)), "");
  ::umask(before);
  EXPECT_EQ(stored(), 1000);
  EXPECT_EQ(kept.store(signed_list_of(999, kAuthority)), "");
  EXPECT_EQ(stored(), 1000);
  EXPECT_EQ(kept.store(signed_list_of(1001, kNext)), "") << "not one of ours";
  EXPECT_EQ(stored(), 1000);
  EXPECT_EQ(kept.store(signed_list_of(1001, kAuthority)), "");
  EXPECT_EQ(stored(), 1001);
  EXPECT_THAT(
      RevocationsFile("/proc/nowhere/list", authorities).store(signed_list_of(1, kAuthority)),
      HasSubstr("cannot write"));
}

TEST_F(KeyOptionsTest, OptionsOfAFleetThatDoNotFitAreNamed) {
  const std::string authority = authority_text(kAuthority);
  EXPECT_THAT(
      problem_of({.key = own(), .authorities = {authority, authority, authority}}, Trusts::kMany),
      HasSubstr("2 --authority: at most two"));
  EXPECT_THAT(
      problem_of({.key = own(), .trusted = {text_of(2)}, .revocations = "f"}, Trusts::kMany),
      HasSubstr("2 --revocations is of lists"));
  EXPECT_THAT(problem_of({.key = own(), .authorities = {authority}, .revocations_stale = "refuse"},
                         Trusts::kMany),
              HasSubstr("2 --revocations-stale"));
  EXPECT_THAT(problem_of({.insecure = true, .credential = "f"}, Trusts::kThePeer),
              HasSubstr("leave out --credential"));
  EXPECT_THAT(problem_of({.key = own(), .authorities = {authority}}, Trusts::kThePeer),
              HasSubstr("3 the roadside unit's key is missing"));
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
}  // namespace interneuron::settings::key_options_test
