#include "host/io/nic_choice.h"

#include <gtest/gtest.h>

#include <vector>

namespace interneuron::io::nic_choice_test {
namespace {

Nic nic(std::string name, std::string kind, std::string mac = "") {
  Nic out;
  out.name = std::move(name);
  out.kind = std::move(kind);
  out.mac = std::move(mac);
  return out;
}

const std::vector<Nic> kNics = {nic("lo", "loopback"), nic("wwan0", "wwan", "02:aa:00:00:00:01"),
                                nic("wwan1", "wwan", "02:aa:00:00:00:02"),
                                nic("eth0", "ethernet", "02:00:00:00:00:01")};

std::string chosen(std::string_view pattern) {
  std::string out;
  for (const Nic& n : kNics) {
    if (matches(pattern, n)) out += n.name + " ";
  }
  return out;
}

TEST(NicChoice, ByNameGlobKindAndHardwareAddress) {
  EXPECT_EQ(chosen("wwan0"), "wwan0 ");
  EXPECT_EQ(chosen("wwan"), "");  // a name is no prefix
  EXPECT_EQ(chosen("wwan*"), "wwan0 wwan1 ");
  EXPECT_EQ(chosen("*0"), "wwan0 eth0 ");
  EXPECT_EQ(chosen("wwan[1-9]"), "wwan1 ");
  EXPECT_EQ(chosen("e?h0"), "eth0 ");
  EXPECT_EQ(chosen("*"), "wwan0 wwan1 eth0 ");
  EXPECT_EQ(chosen("lo"), "lo ");
  EXPECT_EQ(chosen("kind:loopback"), "lo ");
  EXPECT_EQ(chosen("kind:wwan"), "wwan0 wwan1 ");
  EXPECT_EQ(chosen("kind:WWAN"), "wwan0 wwan1 ");
  EXPECT_EQ(chosen("mac:02:AA:00:00:00:02"), "wwan1 ");
  EXPECT_EQ(chosen("mac:"), "");  // lo has none, which is no match
  EXPECT_EQ(chosen(""), "");
}

TEST(NicChoice, RulesAreToldFromNames) {
  for (const char* rule : {"wwan*", "e?h0", "wwan[01]", "kind:wifi", "mac:02:00:00:00:00:01"}) {
    EXPECT_TRUE(is_nic_rule(rule)) << rule;
    EXPECT_EQ(nic_pattern_error(rule), "") << rule;
  }
  for (const char* name : {"wwan0", "br-1.5", "kind", "mac"}) EXPECT_FALSE(is_nic_rule(name));
}

TEST(NicChoice, WhatCannotMatchAnythingIsNamed) {
  EXPECT_EQ(nic_pattern_error(""), "an empty name of a network card");
  EXPECT_EQ(nic_pattern_error("kind:"), "\"kind:\" names no kind; say kind:wwan, for example");
  for (const char* mac : {"mac:", "mac:02:00", "mac:02-00-00-00-00-01", "mac:02:00:00:00:00:0g"}) {
    EXPECT_NE(nic_pattern_error(mac), "") << mac;
  }
}

TEST(NicChoice, WhenNothingMatchesThoseThatAreThereAreListed) {
  EXPECT_EQ(no_match_text("eth9", kNics),
            "no network card named eth9; there are lo, wwan0, wwan1, eth0");
  EXPECT_EQ(no_match_text("kind:wifi", kNics),
            "no network card matches kind:wifi; there are lo (loopback), wwan0 (wwan), wwan1 "
            "(wwan), eth0 (ethernet)");
  EXPECT_EQ(no_match_text("mac:02:00:00:00:00:09", kNics),
            "no network card matches mac:02:00:00:00:00:09; there are lo, wwan0 "
            "(02:aa:00:00:00:01), wwan1 (02:aa:00:00:00:02), eth0 (02:00:00:00:00:01)");
}

}  // namespace
}  // namespace interneuron::io::nic_choice_test
