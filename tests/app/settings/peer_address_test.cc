// HOST[:PORT] in all its forms; the resolver is asked only for what is in every /etc/hosts.
#include "app/settings/peer_address.h"

#include <gtest/gtest.h>

#include "app/process/failure.h"

namespace interneuron::settings::peer_address_test {
namespace {

TEST(PeerAddress, TakesAddressesWithAndWithoutAPort) {
  EXPECT_EQ(to_string(resolve_peer("192.0.2.7")), "192.0.2.7:47000");
  EXPECT_EQ(to_string(resolve_peer("192.0.2.7:862")), "192.0.2.7:862");
  EXPECT_EQ(to_string(resolve_peer("2001:db8::7")), "[2001:db8::7]:47000");
  EXPECT_EQ(to_string(resolve_peer("[2001:db8::7]")), "[2001:db8::7]:47000");
  EXPECT_EQ(to_string(resolve_peer("[2001:db8::7]:862")), "[2001:db8::7]:862");
  EXPECT_EQ(to_string(resolve_peer("fe80::1%lo")), "[fe80::1%lo]:47000");
  EXPECT_EQ(to_string(resolve_peer("192.0.2.7", "--peer", 862)), "192.0.2.7:862");
}

TEST(PeerAddress, TakesNames) {
  const Address address = resolve_peer("localhost:5000");
  EXPECT_TRUE(is_loopback(address)) << to_string(address);
  EXPECT_EQ(port_of(address), 5000);
}

TEST(PeerAddress, NamesTheOptionOfWhatIsNone) {
  for (const char* text : {"", ":47000", "host:", "host:0", "host:65536", "host:port", "[::1",
                           "[::1]:x", "[::1]47000", "192.0.2.7:0", "0.0.0.0", "::"}) {
    try {
      resolve_peer(text, "--nic");
      ADD_FAILURE() << text;
    } catch (const process::Failure& failure) {
      EXPECT_EQ(failure.code(), process::kUsage) << text;
      EXPECT_EQ(std::string(failure.what()).find(std::string("--nic '") + text + "'"), 0U)
          << failure.what();
    }
  }
}

}  // namespace
}  // namespace interneuron::settings::peer_address_test
