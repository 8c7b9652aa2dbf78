#include "app/offload/offload_request.h"

#include <gtest/gtest.h>

namespace interneuron::offload::offload_request_test {
namespace {

using namespace std::chrono_literals;

TEST(OffloadRequest, GoesAroundAndRefusesAnythingElse) {
  const Bytes image(10, std::byte{7});
  Bytes bytes = with_request(61'500us, image);
  const auto parsed = parse_request(bytes);
  ASSERT_TRUE(parsed);
  EXPECT_EQ(parsed->first, Duration(61'500us));
  EXPECT_EQ(parsed->second.size(), 10U);
  for (std::size_t n = 0; n < kRequestBytes; ++n)
    EXPECT_FALSE(parse_request(ByteView(bytes).first(n)));
  for (std::size_t i = 0; i < 4; ++i) {
    Bytes other = bytes;
    other[i] ^= std::byte{1};
    EXPECT_FALSE(parse_request(other)) << i;
  }
}

}  // namespace
}  // namespace interneuron::offload::offload_request_test
