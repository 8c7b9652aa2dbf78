#include "app/settings/link_options.h"

#include <gmock/gmock.h>
#include <rapidcheck/gtest.h>

#include <fstream>

#include "app/process/failure.h"
#include "app/settings/config_file.h"
#include "tests/app/cli/support.h"

namespace interneuron::settings::link_options_test {
namespace {

using testing::HasSubstr;
using testing::Not;

// What `text` is refused with; empty when it is accepted.
std::string refused(const std::string& text, LinkPeer peer = LinkPeer::kNamed) {
  try {
    parse_link_option(text, peer);
  } catch (const process::Failure& failure) {
    EXPECT_EQ(failure.code(), process::kUsage);
    EXPECT_THAT(failure.what(), HasSubstr("'" + text + "'"));
    return failure.what();
  }
  return "";
}

TEST(LinkOptions, TheShortFormIsAsItAlwaysWas) {
  const LinkOption link = parse_link_option("wwan0=192.0.2.7:47000", LinkPeer::kNamed);
  EXPECT_EQ(link, (LinkOption{"wwan0", "192.0.2.7:47000", {}}));
  EXPECT_EQ(parse_link_option("eth0", LinkPeer::kNone), (LinkOption{"eth0", "", {}}));
}

TEST(LinkOptions, AttributesFollowTheAddress) {
  const LinkOption link = parse_link_option(
      "wwan*=[2001:db8::7]:47000,role=backup,priority=2,metered,rate_cap=20mbit,trusted",
      LinkPeer::kNamed);
  EXPECT_EQ(link.nic, "wwan*");
  EXPECT_EQ(link.peer, "[2001:db8::7]:47000");
  EXPECT_EQ(link.traits, (LinkTraits{.role = LinkRole::kBackup,
                                     .priority = 2,
                                     .metered = true,
                                     .rate_cap = DataRate::mbit(20),
                                     .trusted = true}));
}

TEST(LinkOptions, RatesHaveUnits) {
  const auto cap = [](const std::string& rate) {
    return parse_link_option("a,rate_cap=" + rate, LinkPeer::kNone)
        .traits.rate_cap->bits_per_second;
  };
  EXPECT_EQ(cap("500kbit"), 500'000);
  EXPECT_EQ(cap("1.5mbit"), 1'500'000);
  EXPECT_EQ(cap("1gbit"), 1'000'000'000);
  for (const char* bad : {"20", "mbit", "-1mbit", "0mbit", "nanmbit", "20Mb", "1 mbit"}) {
    EXPECT_THAT(refused("a=1.2.3.4:5,rate_cap=" + std::string(bad)), HasSubstr("20mbit")) << bad;
  }
}

TEST(LinkOptions, MistakesAreNamedWithTheRemedy) {
  EXPECT_THAT(refused("wwan0"), HasSubstr("NIC=ADDRESS:PORT"));
  EXPECT_THAT(refused("=192.0.2.7:1"), HasSubstr("NIC=ADDRESS:PORT"));
  EXPECT_THAT(refused("wwan0=road.example:1"), HasSubstr("NIC=ADDRESS:PORT"));
  EXPECT_THAT(refused("wwan0=road.example:1"), HasSubstr("'road.example' is a name"));
  EXPECT_THAT(refused("wwan0=[2001:db8::7:1"), Not(HasSubstr("is a name")));
  EXPECT_THAT(refused("wwan0=localhost"), HasSubstr("NIC=ADDRESS:PORT"));
  EXPECT_THAT(refused("kind:=192.0.2.7:1"), HasSubstr("kind:wwan"));
  EXPECT_THAT(refused("w=1.2.3.4:5,rol=backup"), HasSubstr("did you mean 'role'"));
  EXPECT_THAT(refused("w=1.2.3.4:5,role=spare"), HasSubstr("normal, backup or never"));
  EXPECT_THAT(refused("w=1.2.3.4:5,role"), HasSubstr("normal, backup or never"));
  EXPECT_THAT(refused("w=1.2.3.4:5,priority=-1"), HasSubstr("0 to 255"));
  EXPECT_THAT(refused("w=1.2.3.4:5,priority=1x"), HasSubstr("0 to 255"));
  EXPECT_THAT(refused("w=1.2.3.4:5,metered=yes"), HasSubstr("true or false"));
  EXPECT_THAT(refused("w=1.2.3.4:5,,trusted"), HasSubstr("unknown attribute"));
  EXPECT_THAT(refused("eth0=1.2.3.4:5", LinkPeer::kNone), HasSubstr("eth0,trusted"));
}

TEST(LinkOptions, NamesBecomeLinksAndPatternsRules) {
  NodeOptions options;
  options.links.push_back({.id = LinkId{1}, .nic = "old"});
  append_links({"a=1.2.3.4:5", "kind:wwan=1.2.3.4:6,metered", "b=1.2.3.4:7,priority=3"},
               LinkPeer::kNamed, options);
  ASSERT_EQ(options.links.size(), 3U);
  EXPECT_EQ(options.links[1].nic, "a");
  EXPECT_EQ(options.links[1].id, LinkId{0});
  EXPECT_EQ(options.links[2].id, LinkId{2});
  EXPECT_EQ(options.links[2].traits.priority, 3);
  ASSERT_EQ(options.rules.size(), 1U);
  EXPECT_EQ(options.rules[0].pattern, "kind:wwan");
  EXPECT_EQ(options.rules[0].peer, "1.2.3.4:6");
  EXPECT_TRUE(options.rules[0].traits.metered);
}

RC_GTEST_PROP(LinkOptions, TextAndBackIsTheSame, ()) {
  LinkOption link;
  link.nic = *rc::gen::element<std::string>("wwan0", "eth*", "kind:wifi", "mac:02:00:00:00:00:01");
  link.peer = *rc::gen::element<std::string>("10.0.0.1:1", "[fe80::1%eth0]:47000");
  link.traits.role = *rc::gen::element(LinkRole::kNormal, LinkRole::kBackup, LinkRole::kNever);
  link.traits.priority = *rc::gen::inRange(0, 256);
  link.traits.metered = *rc::gen::arbitrary<bool>();
  link.traits.trusted = *rc::gen::arbitrary<bool>();
  if (*rc::gen::arbitrary<bool>()) {
    link.traits.rate_cap = DataRate{*rc::gen::inRange<std::int64_t>(1, 1'000'000) * 1000};
  }
  RC_ASSERT(parse_link_option(to_string(link), LinkPeer::kNamed) == link);
}

// Any text is accepted or refused with a line, never more.
RC_GTEST_PROP(LinkOptions, AnyTextIsReadOrRefused, (const std::string& text)) {
  try {
    parse_link_option(text, LinkPeer::kNamed);
  } catch (const process::Failure& failure) {
    RC_ASSERT(failure.code() == process::kUsage);
  }
}

// --- the configuration file

struct Command {
  CLI::App app{"test", "vehicle"};
  std::vector<std::string> links;

  Command() {
    add_link_option(app, "--link", links, LinkPeer::kNamed);
    add_config_option(app);
  }
  std::string apply(const std::string& text) {
    const cli::TempFolder folder;
    const std::string file = folder / "c.toml";
    std::ofstream(file) << text;
    try {
      app.parse("--config '" + file + "'", false);
      apply_config(app);
    } catch (const process::Failure& failure) {
      EXPECT_EQ(failure.code(), process::kConfiguration);
      const std::string what = failure.what();
      return what.substr(what.find("c.toml"));
    }
    return "";
  }
};

TEST(LinkTables, SayTheSameAsTheOptions) {
  Command c;
  EXPECT_EQ(c.apply("[[link]]\nnic = 'wwan0'\npeer = '192.0.2.7:47000'\nrole = 'backup'\n"
                    "priority = 1\nmetered = true\nrate_cap_mbit = 20\ntrusted = false\n"
                    "[[link]]\nnic = 'kind:wifi'\npeer = '192.0.2.8:1'\nrate_cap_mbit = 0.5\n"),
            "");
  EXPECT_EQ(c.links, (std::vector<std::string>{
                         "wwan0=192.0.2.7:47000,role=backup,priority=1,metered,rate_cap=20mbit",
                         "kind:wifi=192.0.2.8:1,rate_cap=0.5mbit"}));
}

TEST(LinkTables, AreRefusedWithThePlace) {
  const std::string head = "[[link]]\nnic = 'w'\npeer = '1.2.3.4:5'\n";
  struct Case {
    const char* line;
    const char* says;
  };
  for (const Case& c : std::initializer_list<Case>{
           {"rol = 'backup'", "unknown key 'rol' of [[link]]; did you mean 'role'?"},
           {"role = 'spare'", "role: give normal, backup or never"},
           {"role = 3", "role: give normal"},
           {"priority = 1.5", "priority: give a whole number"},
           {"priority = 256", "priority: give a whole number"},
           {"metered = 'yes'", "metered: give true or false"},
           {"rate_cap_mbit = 0", "rate_cap_mbit: give a number above 0"},
           {"rate_cap_mbit = 'fast'", "rate_cap_mbit: give a number above 0"}}) {
    const std::string error = Command().apply(head + c.line + "\n");
    EXPECT_THAT(error, HasSubstr("c.toml:4:")) << c.line;
    EXPECT_THAT(error, HasSubstr(c.says)) << c.line;
  }
  EXPECT_THAT(Command().apply("[[link]]\npeer = '1.2.3.4:5'\n"), HasSubstr("c.toml:1:"));
  EXPECT_THAT(Command().apply("[[link]]\nnic = 'w'\n"), HasSubstr("c.toml:1:"));
  EXPECT_THAT(Command().apply("[[link]]\nnic = 'w'\npeer = 'x'\n"), HasSubstr("c.toml:3:"));
  EXPECT_THAT(Command().apply("[[link]]\nnic = 'w'\npeer = 'road.example:1'\n"),
              HasSubstr("'road.example' is a name"));
  EXPECT_THAT(Command().apply("link = ['w']\n"), HasSubstr("NIC=ADDRESS:PORT"));
}

TEST(LinkTables, OtherKeysAreNoTables) {
  EXPECT_THAT(Command().apply("[[links]]\nnic = 'w'\n"), HasSubstr("did you mean 'link'"));
}

}  // namespace
}  // namespace interneuron::settings::link_options_test
