#include "app/settings/command_line.h"

#include <gmock/gmock.h>

namespace interneuron::settings::command_line_test {
namespace {

using testing::HasSubstr;

struct Program {
  CLI::App app{"test"};
  CLI::App* demo = app.add_subcommand("demo", "");
  CLI::App* testbed = app.add_subcommand("testbed", "");
  int rounds = 0;
  double deadline_ms = 130;
  std::string hidden;

  Program() {
    app.fallthrough();
    app.require_subcommand(1);
    demo->add_option("--rounds", rounds);
    demo->add_option("--deadline-ms", deadline_ms)->check(positive_number());
    demo->add_option("--hidden", hidden)->group("");
    testbed->require_subcommand(1);
    testbed->add_subcommand("status", "");
  }
  // What the arguments are refused with; empty when they are accepted.
  std::string refused(const std::string& arguments) {
    try {
      app.parse(arguments, false);
    } catch (const CLI::ParseError& error) {
      return mistake_in(app, error);
    }
    return "";
  }
};

TEST(CommandLine, WhatIsRightIsNotRefused) {
  EXPECT_EQ(Program().refused("demo --rounds 5 --deadline-ms 0.5"), "");
  EXPECT_EQ(Program().refused("testbed status"), "");
}

TEST(CommandLine, AnUnknownOptionIsNamedWithTheNearest) {
  EXPECT_EQ(Program().refused("demo --round 5"),
            "unknown option '--round' of `interneuron demo`; did you mean '--rounds'?");
  EXPECT_THAT(Program().refused("demo --deadlin-ms=5"), HasSubstr("did you mean '--deadline-ms'?"));
  EXPECT_THAT(Program().refused("demo --qwertz"),
              HasSubstr("`interneuron demo --help` lists them"));
  EXPECT_THAT(Program().refused("demo --hiden x"),
              HasSubstr("`interneuron demo --help` lists them"))
      << "what the help does not show is not suggested either";
}

TEST(CommandLine, AnUnknownCommandIsNamedWithTheNearest) {
  EXPECT_EQ(Program().refused("testbed stauts"),
            "unknown command 'stauts' of `interneuron testbed`; did you mean 'status'?");
  EXPECT_EQ(unknown_command(Program().app, "dmo"), "unknown command 'dmo'; did you mean 'demo'?");
  EXPECT_EQ(unknown_command(Program().app, "fly"),
            "unknown command 'fly'; `interneuron --help` lists them");
  EXPECT_THAT(Program().refused("testbed"), HasSubstr("subcommand"));
}

TEST(CommandLine, AnArgumentTooManyIsNamed) {
  EXPECT_THAT(Program().refused("demo now"), HasSubstr("`interneuron demo` takes no 'now'"));
}

TEST(CommandLine, NumbersAreReadWhole) {
  for (const char* text : {"x", "0", "-1", "nan", "inf", "5x", "1e999"}) {
    const std::string what = Program().refused(std::string("demo --deadline-ms=") + text);
    EXPECT_THAT(what,
                HasSubstr("--deadline-ms: '" + std::string(text) + "': give a number above 0"));
    EXPECT_LT(what.size(), 120U) << what;
  }
}

}  // namespace
}  // namespace interneuron::settings::command_line_test
