// `interneuron keys`, and programs that meet by the keys that it made.
#include <sys/stat.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "beside.h"
#include "support.h"
#include "tests/node/io/namespace.h"

namespace interneuron::cli::keys_test {
namespace {

using nlohmann::json;

std::string first_line(const std::string& text) { return text.substr(0, text.find('\n')); }

class Keys : public testing::Test {
 protected:
  std::string file(const std::string& name) const { return folder_ / name; }
  // Makes a key and returns its public half.
  std::string make(const std::string& name) const {
    const Ran ran = run("keys gen --out '" + file(name) + "'", false);
    EXPECT_EQ(ran.code, 0) << ran.output;
    EXPECT_EQ(ran.output.size(), 45U) << ran.output;
    return first_line(ran.output);
  }
  TempFolder folder_;
};

TEST_F(Keys, AreMadeOnceAndTellTheirPublicHalf) {
  const std::string key = make("key");
  struct stat status {};
  ASSERT_EQ(::stat(file("key").c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 07777, 0600U);
  EXPECT_EQ(first_line(run("keys pub '" + file("key") + "'").output), key);
  EXPECT_THAT(run("keys gen --out '" + file("key") + "'"), EndsSaying(1, "no key is overwritten"));
  EXPECT_EQ(first_line(run("keys pub '" + file("key") + "'").output), key);
  EXPECT_NE(make("other"), key);
}

TEST_F(Keys, TheDefaultPlaceIsMadeAndUsed) {
  const auto at_home = [this](const std::string& arguments) {
    return run_program("env", "XDG_CONFIG_HOME='" + folder_.string() + "' '" + places::program() +
                                  "' " + arguments);
  };
  EXPECT_EQ(at_home("keys gen").code, 0);
  struct stat status {};
  ASSERT_EQ(::stat(file("interneuron").c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 07777, 0700U);
  EXPECT_EQ(at_home("keys pub").output, run("keys pub '" + file("interneuron/key") + "'").output);
  EXPECT_THAT(at_home("road --nic lo --ladder none"), EndsSaying(3, "nobody is trusted"));
}

// RFC 7748 §6.1: Bob's keys.
TEST_F(Keys, ThePublicHalfIsThatOfTheRfc) {
  const Ran ran = run_program("sh", "-c 'echo XasIfmJKikt54X+Lg4AO5m87sSkmGLb9HC+LJ/+I4Os= | \"" +
                                        places::program() + "\" keys pub -'");
  EXPECT_EQ(ran.code, 0) << ran.output;
  EXPECT_EQ(ran.output, "3p7bfXt9wbTTW2HC7OQ1Nz+DQ8hbeGdNrfx+FG+IK08=\n");
}

TEST_F(Keys, SharedOnesDiffer) {
  const Ran one = run("keys psk");
  EXPECT_EQ(one.code, 0);
  EXPECT_EQ(one.output.size(), 45U);
  EXPECT_NE(one.output, run("keys psk").output);
}

TEST_F(Keys, AFileThatOthersMayReadIsRefused) {
  make("key");
  ASSERT_EQ(::chmod(file("key").c_str(), 0640), 0);
  for (const std::string command : {"keys pub ", "road --nic lo --ladder none --key "}) {
    EXPECT_THAT(run(command + "'" + file("key") + "'"), EndsSaying(3, "chmod 600"));
  }
}

// A roadside unit on the loopback card that trusts one key, and its options.
std::string road(const std::string& options) {
  return "'" + places::program() + "' road --nic lo --port 0 --ladder none " + options;
}

TEST_F(Keys, WhoIsTrustedIsServedAndNobodyElse) {
  const std::string unit = make("road");
  const std::string guest = make("guest");
  make("stranger");
  std::ofstream(file("psk")) << run("keys psk").output;
  ASSERT_EQ(::chmod(file("psk").c_str(), 0600), 0);
  const Beside beside(
      road("--key '" + file("road") + "' --trust '" + guest + ",psk=" + file("psk") + "'"));
  ASSERT_TRUE(beside.ready());
  const auto ask = [&](const std::string& options) {
    return run("links --link lo=127.0.0.1:" + beside.port() + " --for 1.5 --json " + options,
               false);
  };
  const std::string with_psk = "--peer-key '" + unit + ",psk=" + file("psk") + "'";
  const Ran served = ask("--key '" + file("guest") + "' " + with_psk);
  EXPECT_EQ(served.code, 0) << served.output;
  for (const json& link : json::parse(served.output)["links"]) {
    if (link["name"] != "lo") continue;
    EXPECT_GE(link["evidence"]["handshake_packets"], 1);
    EXPECT_EQ(link["evidence"]["unauthentic_packets"], 0);
  }
  EXPECT_EQ(ask("--key '" + file("stranger") + "' " + with_psk).code, 1) << "another key";
  EXPECT_EQ(ask("--key '" + file("guest") + "' --peer-key " + unit).code, 1) << "no shared key";
  EXPECT_EQ(ask("--insecure").code, 1) << "in the clear";
}

TEST_F(Keys, WhoIsTrustedMayMeasureAndNobodyElse) {
  const std::string unit = make("road");
  const std::string guest = make("guest");
  const std::string stranger = make("stranger");
  const Beside beside(road("--key '" + file("road") + "' --trust " + guest));
  ASSERT_TRUE(beside.ready());
  const auto probe = [&](const std::string& options) {
    return run("probe --peer 127.0.0.1:" + beside.port() +
                   " --count 20 --interval 2ms --timeout 500ms --json " + options,
               false);
  };
  const Ran served = probe("--key '" + file("guest") + "' --peer-key " + unit);
  ASSERT_EQ(served.code, 0) << served.output;
  const json nic = json::parse(served.output)["nics"][0];
  EXPECT_EQ(nic["answered_packets"], 20);
  EXPECT_GT(nic["train_answered_packets"].get<int>(), 0);
  EXPECT_THAT(run("probe --peer 127.0.0.1:" + beside.port() + " --key '" + file("stranger") +
                  "' --peer-key " + unit),
              EndsSaying(1, "--trust " + stranger));
  EXPECT_EQ(probe("--insecure").code, 1) << "in the clear";
  EXPECT_EQ(run("probe --peer 127.0.0.1 --stamp --insecure").code, 2);
}

// With keys a roadside unit may have a public address; in the clear it may not, and STAMP, which
// has no keys, has to be asked for.
TEST_F(Keys, PublicAddressesAreForThoseWhoHaveSome) {
  const std::string guest = make("guest");
  make("road");
  io::in_namespace([&] {
    ASSERT_TRUE(io::shell("ip addr add 203.0.113.5/24 dev va"));
    const std::string keys = "--key '" + file("road") + "' --trust " + guest;
    const std::string on_va = "road --nic va --ladder none ";
    EXPECT_THAT(run(on_va + "--insecure"), EndsSaying(1, "va has the public address 203.0.113.5"));
    const Ran stamp = run(on_va + keys + " --stamp 8620");
    EXPECT_EQ(stamp.code, 1) << stamp.output;
    EXPECT_NE(stamp.output.find("pass --stamp-public"), std::string::npos) << stamp.output;
    for (const std::string options : {"", " --stamp 8620 --stamp-public"}) {
      const Beside unit("'" + places::program() + "' " + on_va + keys + options);
      EXPECT_TRUE(unit.ready()) << options;
    }
  });
}

TEST_F(Keys, TheTimeThatWasReachedIsStoredAtTheEnd) {
  const std::string guest = make("guest");
  make("road");
  { const Beside beside(road("--key '" + file("road") + "' --trust " + guest)); }
  std::int64_t stored = 0;
  std::ifstream(file("road.time")) >> stored;
  EXPECT_NEAR(static_cast<double>(stored), 1e9 * static_cast<double>(::time(nullptr)), 60e9);
}

TEST_F(Keys, APlaceThatCannotBeWrittenIsAWarning) {
  const std::string guest = make("guest");
  make("road");
  // A folder cannot be replaced by a file.
  std::filesystem::create_directory(file("road.time"));
  const Ran ran =
      run_program("timeout", "-s TERM 2 " + road("--key '" + file("road") + "' --trust " + guest));
  EXPECT_NE(ran.output.find("ready"), std::string::npos) << ran.output;
  EXPECT_NE(ran.output.find("peers refuse it"), std::string::npos) << ran.output;
}

}  // namespace
}  // namespace interneuron::cli::keys_test
