#include "host/io/nic.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace interneuron::io::nic_test {
namespace {

TEST(Nic, TheLoopbackCardIsThere) {
  const auto lo = find_nic("lo");
  ASSERT_TRUE(lo);
  EXPECT_TRUE(lo->up);
  EXPECT_GE(lo->mtu, 1500u);
  EXPECT_THAT(lo->addresses, testing::Contains(*make_address("127.0.0.1", 0)));
}

TEST(Nic, AnUnknownOneIsNamedWithThoseThatExist) {
  EXPECT_FALSE(find_nic("nosuch0"));
  const std::string text = unknown_nic_text("nosuch0");
  EXPECT_THAT(text, testing::StartsWith("no network card named nosuch0; there are "));
  EXPECT_THAT(text, testing::ContainsRegex("[ ,]lo(,|$)"));
}

}  // namespace
}  // namespace interneuron::io::nic_test
