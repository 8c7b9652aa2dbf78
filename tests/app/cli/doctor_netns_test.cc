// The doctor on real cards in a namespace of the test's own: what is wrong is found, and the
// commands that it prints make the finding go away.
#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include <array>
#include <cstdio>
#include <fstream>
#include <future>
#include <memory>

#include "beside.h"
#include "support.h"
#include "tests/app/watch/json_schema.h"
#include "tests/node/io/namespace.h"

namespace interneuron::cli::doctor_netns_test {
namespace {

using io::shell;
using nlohmann::json;

json doctor(const std::string& arguments = "") {
  return json::parse(run("doctor --json " + arguments, false).output, nullptr, false);
}

json find(const json& report, const std::string& check, const std::string& nic) {
  for (const json& f : report["findings"]) {
    if (f["check"] == check && f["subject"] == nic) return f;
  }
  return {{"verdict", "none"}, {"fix", json::array()}};
}

bool is(const json& report, const std::string& check, const std::string& nic,
        const std::string& verdict) {
  const json f = find(report, check, nic);
  if (f["verdict"] == verdict) return true;
  std::printf("%s of %s: %s\n", check.c_str(), nic.c_str(), f.dump().c_str());
  return false;
}

// Does what the doctor says; false when it says nothing.
bool follow(const json& report, const std::string& check, const std::string& nic) {
  const json f = find(report, check, nic);
  bool done = !f["fix"].empty();
  for (const json& command : f["fix"]) {
    const bool fine = shell(command.get<std::string>());
    if (!fine) std::printf("failed: %s\n", command.get<std::string>().c_str());
    done = done && fine;
  }
  return done;
}

bool set(const std::string& key, const std::string& value) {
  return io::write_file(("/proc/sys/net/ipv4/conf/" + key).c_str(), value);
}

// A second card beside va (10.99.0.1/24): vc.
bool second_card(const std::string& address) {
  return shell(
      "ip link add vc type veth peer name vd && ip link set vc up && ip link set vd up && "
      "ip addr add " +
      address + " dev vc");
}

TEST(DoctorNetns, NoRouteIsFoundAndMended) {
  io::in_namespace([] {
    const json before = doctor();
    EXPECT_TRUE(is(before, "route", "va", "problem")) << "a problem without a default route";
    EXPECT_TRUE(watch::violations(watch::schema_of("doctor.json"), before).empty())
        << "output as its schema says";
    EXPECT_EQ(run("doctor").code, 1) << "exit code 1";
    EXPECT_TRUE(follow(before, "route", "va")) << "a fix that works";
    const json after = doctor();
    EXPECT_TRUE(is(after, "route", "va", "ok")) << "no problem after the fix";
    EXPECT_EQ(run("doctor").code, 0) << "exit code 0";
  });
}

TEST(DoctorNetns, AStrictReversePathFilterIsFoundAndMended) {
  io::in_namespace([] {
    if (!second_card("10.98.0.1/24") || !set("all/rp_filter", "0") || !set("va/rp_filter", "1") ||
        !set("vc/rp_filter", "1") || !shell("ip route add default via 10.99.0.2 dev va metric 1") ||
        !shell("ip route add default via 10.98.0.2 dev vc metric 2")) {
      GTEST_SKIP() << "this kernel lacks what the test needs";
    }
    const json before = doctor();
    EXPECT_TRUE(is(before, "rp_filter", "va", "ok")) << "va, where packets leave, is fine";
    EXPECT_TRUE(is(before, "rp_filter", "vc", "problem")) << "vc is not";
    EXPECT_TRUE(is(before, "source_rule", "vc", "warning")) << "vc's address has no rule";
    EXPECT_TRUE(follow(before, "rp_filter", "vc")) << "a fix that works";
    EXPECT_TRUE(is(doctor(), "rp_filter", "vc", "ok")) << "no problem after the fix";
    // The other way to mend it: a rule for the address.
    EXPECT_TRUE(set("vc/rp_filter", "1")) << "strict again";
    EXPECT_TRUE(follow(before, "source_rule", "vc")) << "a rule that can be made";
    const json after = doctor();
    EXPECT_TRUE(is(after, "source_rule", "vc", "ok")) << "the rule is seen";
    EXPECT_TRUE(is(after, "rp_filter", "vc", "ok")) << "and makes the filter harmless";
  });
}

TEST(DoctorNetns, TheSameSubnetTwiceIsFoundAndMended) {
  io::in_namespace([] {
    if (!second_card("10.99.0.7/24") || !set("all/arp_ignore", "0")) {
      GTEST_SKIP() << "this kernel lacks what the test needs";
    }
    const json before = doctor();
    EXPECT_TRUE(is(before, "same_subnet", "va", "problem")) << "a problem of va";
    EXPECT_TRUE(is(before, "same_subnet", "vc", "problem")) << "a problem of vc";
    EXPECT_TRUE(follow(before, "same_subnet", "vc")) << "a fix that works";
    const json after = doctor();
    EXPECT_TRUE(is(after, "same_subnet", "va", "ok")) << "va is fine";
    EXPECT_TRUE(is(after, "same_subnet", "vc", "ok")) << "vc is fine";
  });
}

// Waits until the kernel has finished what it does by itself with new cards: each gets a link-local
// IPv6 address, which is tentative for one to two seconds, and a local route once it is not.
bool ipv6_has_settled() {
  return shell(
      "for nic in va vb; do"
      "  test \"$(cat /proc/sys/net/ipv6/conf/$nic/disable_ipv6)\" = 0 || continue;"
      "  for try in $(seq 200); do"
      "    test -z \"$(ip -6 address show dev $nic tentative)\" &&"
      "      ip -6 route show table local dev $nic | grep -q '^local fe80' && continue 2;"
      "    sleep 0.05;"
      "  done; exit 1;"
      "done");
}

TEST(DoctorNetns, ItChangesNothing) {
  io::in_namespace([] {
    ASSERT_TRUE(ipv6_has_settled()) << "IPv6 addresses stay tentative";
    const auto read = [] {
      const std::unique_ptr<std::FILE, int (*)(std::FILE*)> out(
          ::popen("ip -d addr; ip route show table all; ip rule; "
                  "grep -H . /proc/sys/net/ipv4/conf/*/* 2>/dev/null",
                  "r"),
          &::pclose);
      std::string text;
      std::array<char, 4096> part{};
      while (const std::size_t n = std::fread(part.data(), 1, part.size(), out.get())) {
        text.append(part.data(), n);
      }
      return text;
    };
    const std::string before = read();
    doctor("--peer 10.99.0.1");
    const std::string after = read();
    EXPECT_THAT(before, testing::HasSubstr("rp_filter")) << "addresses, routes and rules as before";
    EXPECT_EQ(before, after) << "addresses, routes and rules as before";
  });
}

TEST(DoctorNetns, PathsAreMeasuredTowardsAPeer) {
  io::in_namespace([] {
    // The loopback card answers everything.
    if (!io::write_file("/proc/sys/net/ipv4/ping_group_range", "0 0")) {
      GTEST_SKIP() << "this kernel lacks what the test needs";
    }
    const json report = doctor("--peer 127.0.0.1");
    EXPECT_TRUE(is(report, "path_mtu", "lo", "ok")) << "1500 bytes pass";
  });
}

// In a testbed of the emulator, which can swallow large packets without a word.
TEST(DoctorNetns, ABlackHoleIsFoundAndMended) {
  const std::string why = no_testbed();
  if (!why.empty()) GTEST_SKIP() << why;
  const std::string name = " --name hole-" + std::to_string(::getpid()) + " ";
  ASSERT_EQ(run("testbed up --backend emulator --profile a=clean" + name).code, 0);
  ASSERT_EQ(run("testbed set" + name + "a up.mtu=1350").code, 0);
  const auto inside = [&name](const std::string& command) {
    return run("testbed run --in vehicle" + name + "-- " + command, false).output;
  };
  const std::string look = "'" + places::program() + "' doctor --json --peer 10.77.0.1";
  const json before = json::parse(inside(look), nullptr, false);
  EXPECT_TRUE(is(before, "path_mtu", "ifa", "problem"));
  const std::string fix = find(before, "path_mtu", "ifa")["fix"].at(0);
  EXPECT_EQ(fix, "ip link set dev ifa mtu 1308");
  inside(fix);
  EXPECT_TRUE(is(json::parse(inside(look), nullptr, false), "path_mtu", "ifa", "ok"));
  run("testbed down" + name);
}

// Across the testbed's NAT, which forgets silent flows after `seconds`.
class BehindNat {
 public:
  BehindNat(const std::string& name, int seconds)
      : name_(" --name " + name + "-" + std::to_string(::getpid()) + " ") {
    EXPECT_EQ(run("testbed up --backend emulator --profile a=clean --nat" + name_).code, 0);
    for (const char* key : {"udp_timeout", "udp_timeout_stream"}) {
      EXPECT_EQ(run("testbed run --in core" + name_ + "-- sh -c 'echo " + std::to_string(seconds) +
                    " > /proc/sys/net/netfilter/nf_conntrack_" + key + "'")
                    .code,
                0);
    }
    road_ = std::make_unique<Beside>(
        "env XDG_RUNTIME_DIR='" + places::build() + "/run' '" + places::program() +
        "' testbed run --in road" + name_ + "-- '" + places::program() +
        "' road --insecure --nic '*' --ladder motion --calibration-runs 1 --video "
        "'" +
        places::source() + "/docs/latency.png'");
    EXPECT_TRUE(road_->ready());
  }
  ~BehindNat() {
    road_.reset();
    run("testbed down" + name_);
  }
  BehindNat(const BehindNat&) = delete;
  BehindNat& operator=(const BehindNat&) = delete;

  json doctor(const std::string& options) const {
    const Ran ran = run("testbed run --in vehicle" + name_ + "-- '" + places::program() +
                            "' doctor --json --peer 10.77.0.1 " + options,
                        false);
    return json::parse(ran.output, nullptr, false);
  }

 private:
  std::string name_;
  std::unique_ptr<Beside> road_;
};

TEST(DoctorNetns, HowLongSilentFlowsStayOpenIsMeasured) {
  const std::string why = no_testbed();
  if (!why.empty()) GTEST_SKIP() << why;
  // Both at once, for time.
  const BehindNat patient("patient", 120);
  auto other =
      std::async(std::launch::async, [&patient] { return patient.doctor("--nat-timeout 15"); });
  const BehindNat forgetful("forgetful", 7);
  const json report = forgetful.doctor("--nat-timeout 10");
  EXPECT_TRUE(is(report, "nat_timeout", "ifa", "problem"));
  EXPECT_THAT(find(report, "nat_timeout", "ifa").value("found", ""),
              testing::StartsWith("UDP flows are open after 5 s of silence, closed after 10 s"));
  EXPECT_TRUE(watch::violations(watch::schema_of("doctor.json"), report).empty());
  EXPECT_TRUE(is(other.get(), "nat_timeout", "ifa", "ok"));
}

TEST(DoctorNetns, CtrlCEndsTheSilencesWithWhatIsKnown) {
  io::in_namespace([] {
    const TempFolder folder;
    const std::string said = folder / "said";
    const std::string answer = folder / "answer";
    run("doctor --json --peer 127.0.0.1 --nat-timeout >" + answer + " 2>" + said +
        " & until grep -q 'silent flows' " + said + "; do sleep 0.02; done; kill -INT $!; wait;");
    std::ifstream in(answer);
    const json f = find(json::parse(in, nullptr, false), "nat_timeout", "lo");
    EXPECT_EQ(f["verdict"], "not checked") << "is interrupted";
    EXPECT_EQ(f["found"], "interrupted") << "is interrupted";
  });
}

TEST(DoctorNetns, SilencesNeedAPeerThatAnswers) {
  io::in_namespace([] {
    const auto says = [](const std::string& options, const char* text) {
      const json f = find(doctor("--peer 127.0.0.1 " + options), "nat_timeout", "lo");
      return f["verdict"] == "not checked" && f.value("found", "").find(text) != std::string::npos;
    };
    EXPECT_TRUE(says("--nat-timeout 5", "interneuron road")) << "what it needs";
    EXPECT_TRUE(says("", "--nat-timeout")) << "the option";
  });
}

}  // namespace
}  // namespace interneuron::cli::doctor_netns_test
