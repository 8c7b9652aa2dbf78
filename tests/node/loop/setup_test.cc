#include "node/loop/link_set.h"

#include <dirent.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>

#include "lab/sim/trust.h"
#include "node/io/steady_clock.h"

namespace interneuron::setup_test {
namespace {

NodeOptions one_link(std::string local = "127.0.0.1") {
  NodeOptions options;
  options.insecure = true;
  options.links = {{.id = LinkId{0}, .nic = "lo", .local_address = std::move(local)}};
  return options;
}

std::size_t open_descriptors() {
  const std::unique_ptr<DIR, int (*)(DIR*)> folder(::opendir("/proc/self/fd"), &::closedir);
  std::size_t count = 0;
  while (::readdir(folder.get()) != nullptr) ++count;
  return count;
}

template <class Error>
std::string error_of(const NodeOptions& options) {
  const std::size_t before = open_descriptors();
  try {
    Node node(options);
    ADD_FAILURE() << "no error";
    return "";
  } catch (const Error& error) {
    EXPECT_EQ(open_descriptors(), before) << "left open after: " << error.what();
    EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
    return error.what();
  }
}

TEST(Setup, ANodeWithoutALinkIsRefused) {
  EXPECT_EQ(error_of<std::invalid_argument>({}), "a node needs at least one link");
}

TEST(Setup, TwoLinksOfOneIdAreRefused) {
  NodeOptions options = one_link();
  options.links.push_back(options.links.front());
  EXPECT_EQ(error_of<std::invalid_argument>(options), "the links lo and lo have the same id 0");
}

TEST(Setup, AnUnknownNicIsNamed) {
  NodeOptions options = one_link();
  options.links.push_back({.id = LinkId{1}, .nic = "nosuch0"});
  EXPECT_THAT(error_of<IoError>(options),
              testing::StartsWith("no network card named nosuch0; there are "));
}

TEST(Setup, ATakenPortIsNamed) {
  Node node(one_link());
  NodeOptions options = one_link();
  options.port = port_of(*node.local_address(LinkId{0}));
  EXPECT_EQ(error_of<IoError>(options),
            "port " + std::to_string(options.port) + " on lo is taken; choose another with --port");
}

TEST(Setup, BadAddressesAreNamed) {
  EXPECT_THAT(error_of<std::invalid_argument>(one_link("localhost")),
              testing::HasSubstr("\"localhost\" of lo is no numeric address"));
  NodeOptions options = one_link();
  for (const char* peer : {"10.0.0.2", "10.0.0.2:0", "0.0.0.0:5", "road:47000"}) {
    options.links[0].peer = peer;
    EXPECT_THAT(error_of<std::invalid_argument>(options),
                testing::HasSubstr("\"" + std::string(peer) + "\" of lo is not like"));
  }
  options.links[0].peer = "[::1]:47000";
  EXPECT_THAT(error_of<std::invalid_argument>(options), testing::HasSubstr("not of the same kind"));
}

TEST(Setup, WorkerCountsAreBounded) {
  NodeOptions options = one_link();
  options.backup_workers = 0;
  EXPECT_EQ(error_of<std::invalid_argument>(options), "backup_workers is 0; it must be 1 to 64");
  options.backup_workers = 1;
  options.computation_workers = 65;
  EXPECT_EQ(error_of<std::invalid_argument>(options),
            "computation_workers is 65; it must be 1 to 64");
}

TEST(Setup, AnEndpointThatRefusesLeavesNothingOpen) {
  NodeOptions options = one_link();
  options.pipelines = {{.id = PipelineId{0}, .stages = {}}};
  error_of<std::invalid_argument>(options);
}

// Keys of which the node draws the rest.
std::shared_ptr<Security> keys(std::initializer_list<int> peers) {
  auto security = std::make_shared<Security>(*sim::security_of(1, peers));
  security->seed = {};
  security->unix_time_ns = 0;
  return security;
}

TEST(Setup, NothingIsServedInTheClearOnAPublicAddress) {
  NodeOptions options = one_link("203.0.113.5");
  options.accept_peers = true;
  EXPECT_EQ(error_of<std::invalid_argument>(options),
            "203.0.113.5 on lo is a public address, where nothing is sent in the clear; use keys "
            "(`interneuron keys gen`) instead of --insecure, or bind a private address");
  options.insecure = false;
  options.security = keys({2});  // then it only fails because lo has no such address
  EXPECT_THAT(error_of<IoError>(options), testing::StartsWith("203.0.113.5 is no address of lo"));
  options = one_link("");
  options.accept_peers = true;
  Node every_address_of_lo_is_private(options);
  EXPECT_TRUE(is_unspecified(*every_address_of_lo_is_private.local_address(LinkId{0})));
}

TEST(Setup, NothingIsSentInTheClearToAPublicAddress) {
  const std::string says =
      "the peer 203.0.113.5:9 has a public address, where nothing is sent in the clear; use keys "
      "(`interneuron keys gen`) instead of --insecure";
  NodeOptions options = one_link();
  options.links[0].peer = "203.0.113.5:9";
  EXPECT_EQ(error_of<std::invalid_argument>(options), says);
  options.links.clear();
  options.rules = {{.pattern = "l*", .traits = {}, .peer = "203.0.113.5:9"}};
  EXPECT_EQ(error_of<std::invalid_argument>(options), says);
  Node node(one_link());
  const std::pair path{LinkId{0}, *parse_address("203.0.113.5:9")};
  EXPECT_THROW(node.connect({&path, 1}), std::invalid_argument);
}

TEST(Setup, ANodeHasKeysOrIsInsecure) {
  NodeOptions options = one_link();
  options.insecure = false;
  EXPECT_THAT(error_of<std::invalid_argument>(options), testing::HasSubstr("needs keys"));
  options.insecure = true;
  options.security = keys({2});
  EXPECT_THAT(error_of<std::invalid_argument>(options), testing::HasSubstr("without keys"));
  options.insecure = false;
  options.security = std::make_shared<Security>();
  EXPECT_THAT(error_of<std::invalid_argument>(options), testing::HasSubstr("no private key"));
}

TEST(Setup, WhoThePeerIsHasToBeClear) {
  NodeOptions options = one_link();
  options.insecure = false;
  options.links[0].peer = "127.0.0.1:9";
  options.security = keys({2, 3});
  EXPECT_THAT(error_of<std::invalid_argument>(options), testing::HasSubstr("which of 2 trusted"));
  options.peer_key = sim::key_of_host(4);
  EXPECT_THAT(error_of<std::invalid_argument>(options),
              testing::HasSubstr(to_base64(sim::key_of_host(4)) + " is not among"));
  options.peer_key = sim::key_of_host(3);
  EXPECT_NO_THROW(Node{options});
  options.peer_key.reset();
  options.security = keys({2});
  EXPECT_NO_THROW(Node{options});
}

TEST(Setup, TheNodeDrawsTheSeedAndReadsTheTimeThatAreNotGiven) {
  NodeOptions options = one_link();
  options.security = keys({2});
  const auto first = endpoint_options(options).security;
  const auto second = endpoint_options(options).security;
  EXPECT_NE(first->seed, SecretKey{});
  EXPECT_NE(first->seed, second->seed);
  EXPECT_EQ(first->key, options.security->key);
  EXPECT_NEAR(static_cast<double>(first->unix_time_ns), static_cast<double>(io::unix_time_ns()),
              60e9);
  auto given = keys({2});
  given->seed = sim::secret_key(7);
  given->unix_time_ns = 8;
  options.security = given;
  EXPECT_EQ(endpoint_options(options).security->seed, sim::secret_key(7));
  EXPECT_EQ(endpoint_options(options).security->unix_time_ns, 8);
}

TEST(Setup, SessionsDifferAndAreNotZero) {
  const EndpointOptions a = endpoint_options(one_link());
  const EndpointOptions b = endpoint_options(one_link());
  EXPECT_NE(a.session.value, 0u);
  EXPECT_NE(a.session, b.session);
  EXPECT_EQ(a.policies.size(), builtin_policies().size());
}

}  // namespace
}  // namespace interneuron::setup_test
