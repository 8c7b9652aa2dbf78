// What messages under way may hold, and whom send() and submit() refuse when it runs short.
#include <gtest/gtest.h>

#include <algorithm>

#include "interneuron/sizes.h"
#include "tests/core/endpoint/pipe.h"

namespace interneuron::budget_test {
namespace {

constexpr std::size_t kBudget = 24 * 1024 * 1024;
constexpr std::size_t kLarge = 8'000'000;

// A host with two peers, which are reached over links that carry 10 Mbit/s together each.
struct Narrow {
  Pipe pipe;
  std::vector<PeerId> peers;
  std::map<LinkId, Duration> free_at;
  Duration waits{};

  Narrow() {
    EndpointOptions options = options_of(1, {pipeline_of({kComm, kComm})}, false);
    options.send_budget_bytes = kBudget;
    pipe.add_host(options);
    pipe.drop = [this](std::size_t from, LinkId link, ByteView bytes) {
      waits = {};
      if (from != 0) return false;
      const Duration air = DataRate{10'000'000}.transmit_time(bytes.size() + kIpUdpBytes);
      free_at[link] = std::max(free_at[link], pipe.now()) + air;
      waits = free_at[link] - pipe.now();
      return false;
    };
    pipe.jitter = [this] { return waits; };
    pipe.spins_allowed = 3;
    for (const std::uint32_t session : {2U, 3U}) {
      peers.push_back(pipe.connect(0, pipe.add_host(options_of(session))));
    }
    pipe.run(3s);
  }
  SendStatus send(std::size_t peer, std::size_t bytes, Duration deadline) {
    SendOptions options{.deadline = deadline, .policy = "best_link"};
    const auto result = pipe.at(0).send(pipe.local(0), peers[peer], {Bytes(bytes)}, options);
    pipe.flush(0);
    return result.status;
  }
};

TEST(Budget, AMinuteOfLargeMessagesForASlowLinkHoldsNoMoreAndOthersFindRoom) {
  Narrow n;
  std::size_t most = 0;
  int accepted = 0;
  int over = 0;
  for (int i = 0; i < 600; ++i) {
    if (i % 5 == 0) {
      const SendStatus status = n.send(0, kLarge, 10s);
      accepted += status == SendStatus::kAccepted ? 1 : 0;
      over += status == SendStatus::kOverBudget ? 1 : 0;
    }
    EXPECT_NE(n.send(1, 5'000, 100ms), SendStatus::kOverBudget);
    most = std::max(most, n.pipe.at(0).sending_bytes());
    n.pipe.run(100ms);
  }
  EXPECT_LE(most, kBudget);
  EXPECT_GE(accepted, 5);
  EXPECT_GT(over, 0);
  n.pipe.run(11s);
  EXPECT_EQ(n.pipe.at(0).sending_bytes(), 0U);
}

TEST(Budget, OnePeerGetsHalfOfItAndAnotherHalfOfTheRest) {
  Narrow n;
  EXPECT_EQ(n.send(0, kLarge, 1h), SendStatus::kAccepted);
  EXPECT_EQ(n.send(0, kLarge, 1h), SendStatus::kOverBudget);
  EXPECT_EQ(n.send(1, kLarge, 1h), SendStatus::kAccepted);
  EXPECT_LE(n.pipe.at(0).sending_bytes(), kBudget);
}

// The event says what send() would say, of all variants that the policy sends.
TEST(Budget, AChannelIsToldOnceThatItCanSendAgain) {
  Narrow n;
  EXPECT_EQ(n.send(0, kLarge, 1h), SendStatus::kAccepted);
  SendOptions options{.deadline = 1h, .policy = "duplicate", .channel = 9};
  std::vector<SendStatus> answers;
  const auto send = [&] {
    Variants variants{Bytes(kLarge), Bytes(100)};
    answers.push_back(
        n.pipe.at(0).send(n.pipe.local(0), n.peers[0], std::move(variants), options).status);
  };
  n.pipe.on_event = [&](std::size_t, Event& e) {
    if (const auto* can = std::get_if<CanSend>(&e)) {
      EXPECT_EQ(can->channel, 9);
      n.pipe.plan(0ns, send);
    }
  };
  send();
  n.pipe.flush(0);
  n.pipe.run(9s);
  EXPECT_EQ(answers, (std::vector{SendStatus::kOverBudget, SendStatus::kAccepted}));
}

TEST(Budget, RoundsAreRefusedByItToo) {
  Narrow n;
  const auto submit = [&n](std::size_t bytes) {
    n.pipe.round(0, PipelineId{0}, {Bytes(bytes)}, n.peers[0]);
    return n.pipe.submitted;
  };
  EXPECT_EQ(submit(kLarge), SubmitStatus::kAccepted);
  EXPECT_EQ(submit(kLarge), SubmitStatus::kOverBudget);
  EXPECT_EQ(submit(1'000), SubmitStatus::kAccepted);
  // Nothing of a round is kept beyond its deadline.
  n.pipe.run(1s);
  EXPECT_EQ(n.pipe.at(0).sending_bytes(), 0U);
  EXPECT_EQ(submit(kLarge), SubmitStatus::kAccepted);
}

}  // namespace
}  // namespace interneuron::budget_test
