// What a plain message needs of links: which carry it, and what its receiver is told.
#include <gtest/gtest.h>

#include "door.h"
#include "interneuron/requirement.h"

namespace interneuron::needs_test {
namespace {

// Over the one link that the weights of the message rank first.
class Weighing final : public Policy {
 public:
  std::string_view name() const override { return "weighing"; }
  Plan plan(const Offer& offer, std::span<const LinkState> links, const Guidance&) const override {
    Plan plan;
    for (const LinkState& link : match({.weights = offer.qos.needs, .links = 1}, links)) {
      plan.sends.push_back({0, link.id});
    }
    return plan;
  }
  Merge merge(const Arrival&) const override { return Merge::kDeliver; }
};

// kFast is sooner there, and kSlow alone is a network that the operator trusts.
struct NeedsTest : ::testing::Test {
  Pipe pipe;
  PeerId peer{};
  std::vector<Pipe::Captured> sent;
  std::vector<Message> came;
  PipelineConfig pipeline = pipeline_of({kComm, kComp, kComm});

  void begin(const Nature& needs) {
    pipeline.needs = needs;
    EndpointOptions vehicle = options_of(1, {pipeline}, false);
    vehicle.policies.push_back(std::make_shared<Weighing>());
    EndpointOptions road = options_of(2, {pipeline});
    road.policies = vehicle.policies;
    pipe.add_host(std::move(vehicle));
    pipe.add_host(std::move(road));
    pipe.at(0).add_link(pipe.local(0), kSlow, {"nic", 1500, {.trusted = true}});
    pipe.on_event = [this](std::size_t host, Event& e) {
      if (auto* m = std::get_if<Message>(&e); m != nullptr && host == 1) came.push_back(*m);
    };
    peer = pipe.connect(0, 1);
    pipe.run(3s);
    pipe.capture = &sent;
  }
  // The links over which pieces have left since the last call.
  std::set<LinkId> used() {
    std::set<LinkId> links;
    for (const Pipe::Captured& c : sent) {
      if (c.from == 0 && c.is_data()) links.insert(c.link);
    }
    sent.clear();
    return links;
  }
  SendResult send(const SendOptions& options) {
    const SendResult result = pipe.at(0).send(pipe.local(0), peer, {Bytes(900)}, options);
    pipe.flush(0);
    pipe.run(200ms);
    return result;
  }
};

class NeedsOf : public NeedsTest, public ::testing::WithParamInterface<Nature> {};

TEST_P(NeedsOf, APlainMessageTakesTheLinksOfARound) {
  pipeline.policy = "weighing";
  begin(GetParam());
  ASSERT_TRUE(send({.policy = "weighing", .needs = {.weights = GetParam()}}).accepted());
  const std::set<LinkId> plain = used();
  pipe.round(0, PipelineId{0}, {Bytes(900)});
  pipe.run(200ms);
  EXPECT_EQ(plain.size(), 1U);
  EXPECT_EQ(plain, used());
  EXPECT_EQ(plain.contains(kSlow), GetParam().security > 0.5);
}
INSTANTIATE_TEST_SUITE_P(Weights, NeedsOf,
                         ::testing::Values(Nature{.delay = 1}, Nature{.security = 1},
                                           Nature{.delay = 0.2, .security = 0.8}));

TEST_F(NeedsTest, ALinkBelowTheFloorOfSecurityCarriesNothingNorRepairs) {
  begin({});
  int lost = 0;
  pipe.drop = [&](std::size_t from, LinkId link, ByteView bytes) {
    return from == 0 && link == kSlow && bytes.size() > 900 && ++lost <= 2;
  };
  ASSERT_TRUE(send({.policy = "duplicate", .needs = {.min_security = 0.5}}).accepted());
  EXPECT_EQ(lost, 3);
  EXPECT_EQ(used(), std::set<LinkId>{kSlow});
  EXPECT_EQ(came.size(), 1U);
}

TEST_F(NeedsTest, WhereNoLinkReachesTheFloorItIsRefusedInWords) {
  begin({});
  const SendResult result = send({.needs = {.min_security = 0.8}});
  EXPECT_EQ(result.status, SendStatus::kLinkRestricted);
  EXPECT_EQ(result.reason, kInsecure);
  EXPECT_THROW(send({.needs = {.min_security = 1.5}}), std::invalid_argument);
}

TEST_F(NeedsTest, TheyAreToldAtTheOtherEndOverHoweverManyPieces) {
  begin({});
  const Needs needs{{.delay = 1, .bandwidth = 0.2, .reliability = 0.4, .security = 0.6}, 0.4};
  for (const std::size_t bytes : {1U, 900U, 100'000U}) {
    came.clear();
    SendOptions options{.deadline = 1s, .needs = needs};
    pipe.at(0).send(pipe.local(0), peer, {Bytes(bytes, std::byte{7})}, options);
    pipe.flush(0);
    pipe.run(1s);
    ASSERT_EQ(came.size(), 1U) << bytes;
    EXPECT_EQ(came[0].bytes, Bytes(bytes, std::byte{7}));
    EXPECT_NEAR(came[0].needs.weights.reliability, 0.4, 1.0 / 255);
    EXPECT_NEAR(came[0].needs.min_security, 0.4, 1.0 / 255);
  }
}

TEST(SendMany, ManyMessagesAtOnceAreEachTheirOwn) {
  Door d;
  std::vector<Bytes> messages;
  for (std::size_t i = 1; i <= 64; ++i) messages.emplace_back(i);
  messages.emplace_back();
  const auto results = d.pipe.at(d.vehicle).send(d.pipe.local(d.vehicle), d.peer,
                                                 std::span(messages), SendOptions{.channel = 4});
  d.pipe.flush(d.vehicle);
  d.pipe.run(500ms);
  ASSERT_EQ(results.size(), 65U);
  EXPECT_EQ(results.back().status, SendStatus::kEmpty);
  EXPECT_EQ(d.came.size(), 64U);
  for (std::size_t i = 0; i < 64; ++i) {
    ASSERT_TRUE(results[i].accepted());
    EXPECT_EQ(d.fate(results[i].id).fate, Fate::kDelivered);
    EXPECT_EQ(d.came[i].what.bytes.size(), i + 1);
  }
}

}  // namespace
}  // namespace interneuron::needs_test
