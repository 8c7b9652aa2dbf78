// A pipeline over two remote nodes, A -> B -> C -> A: every stage is judged, whatever the clocks
// say.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "interneuron/endpoint.h"
#include "pair.h"

namespace interneuron::two_nodes_test {
namespace {

struct Decision {
  std::size_t host;
  std::uint8_t stage;
  std::uint8_t variant;
  bool degraded;
  Verdict verdict;
  Duration at;
  friend bool operator==(const Decision&, const Decision&) = default;
};

std::vector<Decision> over_two_nodes(std::array<Duration, 3> clocks) {
  Pipe pipe;
  for (std::uint32_t i = 0; i < 3; ++i) {
    std::vector<PipelineConfig> pipelines;
    if (i == 0) pipelines.push_back(pipeline_of({kComm, kComp, kComm, kComp, kComm}));
    EndpointOptions options = options_of(i + 1, pipelines);
    // A's rounds reach C through B, and come back to A from C, to which A has sent nothing.
    if (i == 0) options.relays = {address_of(2)};
    if (i == 2) options.relays = {address_of(1)};
    pipe.add_host(std::move(options), clocks[i]);
  }
  const PeerId a_to_b = pipe.connect(0, 1);
  const PeerId b_to_c = pipe.connect(1, 2);
  const PeerId c_to_a = pipe.connect(2, 0);
  std::vector<Decision> out;
  Duration compute = 10ms;
  pipe.on_event = [&](std::size_t host, Event& e) {
    if (auto* d = std::get_if<Delivered>(&e)) {
      out.push_back({host, d->stage, d->variant, d->degraded, d->verdict, pipe.now()});
      pipe.plan(compute, [&pipe, host, ref = d->round, next = host == 1 ? b_to_c : c_to_a] {
        EXPECT_EQ(pipe.submit(host, ref, 10'000, next), SubmitStatus::kAccepted);
      });
    } else if (auto* r = std::get_if<RoundDone>(&e)) {
      out.push_back(
          {host, 5, static_cast<std::uint8_t>(r->outcome), r->degraded_final, {}, pipe.now()});
    }
  };
  pipe.run(1s);
  for (int i = 0; i < 20; ++i) {
    compute = i == 12 ? 45ms : 10ms;                  // D2 and D4 missed
    pipe.extra_from_0[kFast] = i == 15 ? 40ms : 0ms;  // D1 missed by raw
    pipe.round(0, PipelineId{0}, {Bytes(20'000), Bytes(5'000)}, a_to_b);
    pipe.run(100ms);
  }
  return out;
}

TEST(Endpoint, FiveStagesOverTwoNodesAreOnTimeAndJudged) {
  const auto decisions = over_two_nodes({});
  const auto remote = std::ranges::count_if(
      decisions, [](const Decision& d) { return d.stage == 5 && d.variant == 0; });
  EXPECT_GE(remote, 18);
  EXPECT_TRUE(std::ranges::any_of(decisions,
                                  [](const Decision& d) { return d.host == 2 && d.verdict.late; }));
}

TEST(Endpoint, TheSumOfOffsetsMakesDecisionsTheSameForAnyClocks) {
  const auto plain = over_two_nodes({});
  EXPECT_EQ(over_two_nodes({0ns, 1h + 7ns, -24h}), plain);
  EXPECT_EQ(over_two_nodes({24h, 0ns, 12345678901ns}), plain);
  EXPECT_EQ(over_two_nodes({-5h, 3h, -3h}), plain);
}

}  // namespace
}  // namespace interneuron::two_nodes_test
