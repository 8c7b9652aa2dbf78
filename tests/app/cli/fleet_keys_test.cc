// `interneuron keys` of a fleet authority, and programs that meet by what it has signed.
#include <sys/stat.h>

#include <algorithm>
#include <fstream>

#include "beside.h"
#include "support.h"

namespace interneuron::cli::fleet_keys_test {
namespace {

std::string first_line(const std::string& text) { return text.substr(0, text.find('\n')); }

class FleetKeys : public testing::Test {
 protected:
  FleetKeys() {
    authority_ = make("authority", "--authority ");
    unit_ = make("road");
    guest_ = make("guest");
  }
  std::string file(const std::string& name) const { return folder_ / name; }
  std::string text_in(const std::string& name) const {
    std::ifstream in(file(name));
    return {std::istreambuf_iterator<char>(in), {}};
  }
  // Makes a key and returns its public half.
  std::string make(const std::string& name, const std::string& options = "") const {
    const Ran ran = run("keys gen " + options + "--out '" + file(name) + "'", false);
    EXPECT_EQ(ran.code, 0) << ran.output;
    return first_line(ran.output);
  }
  // Signs a key into a file, as the authority in that file.
  void sign(const std::string& key, const std::string& into, const std::string& options = "",
            const std::string& authority = "authority") const {
    const Ran ran = run(
        "keys sign --authority '" + file(authority) + "' --id bus7 " + options + " " + key, false);
    EXPECT_EQ(ran.code, 0) << ran.output;
    std::ofstream(file(into)) << ran.output;
  }
  Ran verify(const std::string& name) const {
    return run("keys verify --authority " + authority_ + " '" + file(name) + "'");
  }
  Ran revoke(const std::string& arguments, const std::string& authority = "authority") const {
    return run("keys revoke --authority '" + file(authority) + "' --list '" + file("revoked") +
               "' " + arguments);
  }
  // A roadside unit on the loopback card with its own key, and these options.
  std::string road(const std::string& options) const {
    return "'" + places::program() + "' road --nic lo --port 0 --ladder none --key '" +
           file("road") + "' " + options;
  }
  // Whether it serves whoever has this key and these options.
  bool serves(const Beside& beside, const std::string& key, const std::string& options) const {
    const Ran ran =
        run("links --link lo=127.0.0.1:" + beside.port() + " --for 1.5 --json --peer-key " + unit_ +
            " --key '" + file(key) + "' " + options);
    EXPECT_TRUE(ran.code == 0 || ran.code == 1) << ran.output;
    return ran.code == 0;
  }
  std::string with(const std::string& credential) const {
    return "--credential '" + file(credential) + "'";
  }

  TempFolder folder_;
  std::string authority_;
  std::string unit_;
  std::string guest_;
};

TEST_F(FleetKeys, AnAuthorityHasAKeyOfItsOwnKind) {
  struct stat status {};
  ASSERT_EQ(::stat(file("authority").c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 07777, 0600U);
  EXPECT_EQ(first_line(run("keys pub --authority '" + file("authority") + "'").output), authority_);
  EXPECT_NE(first_line(run("keys pub '" + file("authority") + "'").output), authority_);
}

// RFC 8032 §7.1, test 1.
TEST_F(FleetKeys, ThePublicHalfIsThatOfTheRfc) {
  const Ran ran = run_program("sh", "-c 'echo nWGxne/9WmC6hEr0kuwsxERJxWl7MmkZcDusAxyuf2A= | \"" +
                                        places::program() + "\" keys pub --authority -'");
  EXPECT_EQ(ran.output, "11qYAYKxCrfVS/7TyWQHOg7hcvPapiMlrwIaaPcHURo=\n");
}

TEST_F(FleetKeys, ACredentialSaysWhoseKeyItIsAndHowLong) {
  sign(guest_, "credential", "--from 2020-02-29 --days 3650");
  EXPECT_EQ(std::ranges::count(text_in("credential"), '\n'), 1);
  const Ran good = verify("credential");
  EXPECT_EQ(good.code, 0);
  EXPECT_EQ(good.output, "credential of the vehicle bus7\nkey " + guest_ +
                             "\nfrom 2020-02-29T00:00:00Z\nuntil 2030-02-26T00:00:00Z\n");
  sign(guest_, "ended", "--from 2020-01-01T12:00:00Z --days 1 --role roadside");
  sign(guest_, "early", "--from 2200-01-01");
  make("other", "--authority ");
  sign(guest_, "of another", "", "other");
  for (const auto& [name, says] : {std::pair("ended", "has ended at 2020-01-02T12:00:00Z"),
                                   std::pair("early", "holds from 2200-01-01T00:00:00Z"),
                                   std::pair("of another", "nothing that this authority")}) {
    const Ran ran = verify(name);
    EXPECT_EQ(ran.code, 1) << ran.output;
    EXPECT_NE(ran.output.find(says), std::string::npos) << ran.output;
    EXPECT_EQ(std::ranges::count(ran.output, '\n'), 1) << ran.output;
  }
  EXPECT_EQ(verify("road").code, 3) << "a private key";
  EXPECT_EQ(verify("nowhere").code, 3);
}

TEST_F(FleetKeys, AListGrowsIsSignedAgainAndIsNewerEachTime) {
  EXPECT_EQ(revoke(guest_).code, 0);
  const std::string first = text_in("revoked");
  EXPECT_EQ(revoke(unit_ + " " + guest_).code, 0);
  EXPECT_THAT(verify("revoked"), EndsSaying(0, ", 2 keys\n" + guest_ + "\n" + unit_ + "\n"));
  const std::string second = text_in("revoked");
  EXPECT_EQ(revoke("").code, 0);
  EXPECT_NE(text_in("revoked"), second) << "newer within the same second";
  EXPECT_EQ(revoke("--remove " + unit_).code, 0);
  EXPECT_NE(verify("revoked").output.find(", 1 key\n"), std::string::npos);
  EXPECT_EQ(revoke("--remove " + unit_).code, 1) << "it is not there";
  const std::string before = text_in("revoked");
  make("next", "--authority ");
  EXPECT_THAT(revoke(unit_, "next"), EndsSaying(3, "--replaces"));
  EXPECT_EQ(text_in("revoked"), before);
  EXPECT_EQ(revoke("--replaces " + authority_ + " " + unit_, "next").code, 0);
  EXPECT_EQ(verify("revoked").code, 1) << "the next authority's now";
}

TEST_F(FleetKeys, WhoIsSignedIsServedAndNobodyElse) {
  const std::string next = make("next", "--authority ");
  make("foreign", "--authority ");
  make("stranger");
  sign(guest_, "credential");
  sign(guest_, "ended", "--from 2020-01-01");
  sign(guest_, "of the next", "", "next");
  sign(guest_, "of a foreign one", "", "foreign");
  sign(guest_, "of a unit", "--role roadside");
  const Beside beside(road("--authority " + authority_ + " --authority " + next));
  ASSERT_TRUE(beside.ready());
  EXPECT_TRUE(serves(beside, "guest", with("credential") + " --authority " + authority_));
  EXPECT_TRUE(serves(beside, "guest", with("of the next"))) << "two authorities";
  EXPECT_FALSE(serves(beside, "guest", ""));
  EXPECT_FALSE(serves(beside, "guest", with("ended")));
  EXPECT_FALSE(serves(beside, "guest", with("of a foreign one")));
  EXPECT_FALSE(serves(beside, "guest", with("of a unit"))) << "units do not join units";
  EXPECT_THAT(run("links --link lo=127.0.0.1:9 --peer-key " + unit_ + " --key '" +
                  file("stranger") + "' " + with("credential")),
              EndsSaying(3, "is the credential of " + guest_));
}

TEST_F(FleetKeys, AListIsHandedOnAndKept) {
  const std::string lost = make("lost");
  sign(guest_, "credential");
  sign(lost, "lost credential");
  EXPECT_EQ(revoke(lost).code, 0);
  const std::string authority = "--authority " + authority_;
  const std::string kept = authority + " --revocations '" + file("kept") + "'";
  const Beside beside(road(kept));
  ASSERT_TRUE(beside.ready());
  EXPECT_TRUE(serves(beside, "lost", with("lost credential"))) << "it does not know the list";
  EXPECT_TRUE(
      serves(beside, "guest",
             with("credential") + " " + authority + " --revocations '" + file("revoked") + "'"));
  EXPECT_FALSE(serves(beside, "lost", with("lost credential")));
  EXPECT_EQ(text_in("kept"), text_in("revoked"));
  EXPECT_TRUE(
      serves(beside, "guest",
             with("credential") + " " + authority + " --revocations '" + file("copy") + "'"));
  EXPECT_EQ(text_in("copy"), text_in("revoked")) << "a vehicle keeps it, too";
}

TEST_F(FleetKeys, WithoutANewListNobodyIsBelievedUnlessAskedFor) {
  sign(guest_, "credential");
  const std::string options = "--authority " + authority_ + " --revocations '" + file("revoked") +
                              "' --revocations-max-age 30 ";
  {
    const Beside beside(road(options));
    ASSERT_TRUE(beside.ready());
    EXPECT_FALSE(serves(beside, "guest", with("credential")));
  }
  {
    const Beside beside(road(options + "--revocations-stale accept"));
    ASSERT_TRUE(beside.ready());
    EXPECT_TRUE(serves(beside, "guest", with("credential")));
  }
  {
    const Beside beside(road(options + "--trust " + guest_));
    ASSERT_TRUE(beside.ready());
    EXPECT_TRUE(serves(beside, "guest", "")) << "who is listed needs no authority";
  }
  EXPECT_EQ(revoke("").code, 0);
  const Beside beside(road(options));
  ASSERT_TRUE(beside.ready());
  EXPECT_TRUE(serves(beside, "guest", with("credential")));
}

TEST_F(FleetKeys, ThatTheListIsMissingIsTold) {
  const Ran ran = run_program(
      "timeout", "-s TERM 2 " + road("--authority " + authority_ + " --revocations-max-age 30"));
  EXPECT_NE(ran.output.find("there is no list of revocations: vehicles that the authority has "
                            "signed are refused"),
            std::string::npos)
      << ran.output;
}

}  // namespace
}  // namespace interneuron::cli::fleet_keys_test
