#include "core/base/source_limit.h"

#include <gtest/gtest.h>

namespace interneuron::same_host_test {
namespace {

TEST(SameHost, LooksAtNoPort) {
  const auto address = [](std::size_t size, std::uint8_t port, std::uint8_t host) {
    Address a{.size = static_cast<std::uint8_t>(size)};
    a.raw[3] = static_cast<std::byte>(port);
    a.raw[7] = static_cast<std::byte>(host);
    return a;
  };
  for (const std::size_t size : {16U, 28U}) {
    EXPECT_TRUE(is_same_host(address(size, 1, 5), address(size, 2, 5)));
    EXPECT_FALSE(is_same_host(address(size, 1, 5), address(size, 1, 6)));
  }
  EXPECT_FALSE(is_same_host(address(6, 1, 5), address(6, 2, 5)));
  EXPECT_FALSE(is_same_host(address(16, 1, 5), address(28, 1, 5)));
  EXPECT_FALSE(is_same_host(Address{}, Address{}));
}

}  // namespace
}  // namespace interneuron::same_host_test
