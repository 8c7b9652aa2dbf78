// Why submit() does not take a message: one test per reason that endpoint_test.cc does not show.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>
#include <string>
#include <vector>

#include "pipe.h"

namespace interneuron::submit_test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

TEST(Submit, WithoutALinkThatIsUpThereIsNoLink) {
  Pipe pipe;
  pipe.add_host(options_of(1, {pipeline_of(offload_stages())}, false));
  pipe.add_host(options_of(2));
  pipe.connect(0, 1);
  pipe.run(1s);
  for (const LinkId link : {kFast, kSlow}) pipe.at(0).remove_link(pipe.local(0), link);
  pipe.round(0);
  EXPECT_EQ(pipe.submitted, SubmitStatus::kNoLink);
}

TEST(Submit, AResultNeedsACommunicationBackToItsOrigin) {
  Pipe pipe;
  pipe.add_host(options_of(1, {pipeline_of({kComm, kComp})}, false));
  pipe.add_host(options_of(2));
  std::vector<SubmitStatus> answers;
  pipe.on_event = [&](std::size_t host, Event& e) {
    const auto* delivered = std::get_if<Delivered>(&e);
    if (delivered == nullptr) return;
    answers.push_back(pipe.submit(host, delivered->round, 10));
    answers.push_back(pipe.submit(host, delivered->round, 10));
  };
  pipe.connect(0, 1);
  pipe.run(1s);
  pipe.round(0);
  pipe.run(100ms);
  EXPECT_THAT(answers, ElementsAre(SubmitStatus::kNoWayToOrigin, SubmitStatus::kRoundOver));
}

TEST(Submit, TheResultOfAComputationAtTheOriginIsItsAnswer) {
  Endpoint endpoint(options_of(1, {pipeline_of({kComp})}), TimePoint{});
  const RoundRef round = endpoint.begin_round(TimePoint{}, PipelineId{0});
  const auto submit = [&] {
    return endpoint.submit(TimePoint{}, round, {Bytes(10)}, MessageClass::kResult);
  };
  EXPECT_EQ(submit(), SubmitStatus::kAccepted);
  EXPECT_EQ(submit(), SubmitStatus::kRoundOver);
}

TEST(Submit, EveryReasonHasALineOfItsOwn) {
  std::vector<std::string_view> lines;
  for (int i = 0; i <= static_cast<int>(SubmitStatus::kRefusedByPolicy); ++i) {
    lines.push_back(to_string(static_cast<SubmitStatus>(i)));
  }
  EXPECT_EQ(lines.front(), "accepted");
  std::ranges::sort(lines);
  EXPECT_EQ(std::ranges::adjacent_find(lines), lines.end());
  EXPECT_EQ(std::ranges::find(lines, "?"), lines.end());
}

TEST(Submit, APolicyThatIsNotRegisteredIsNamedBesideThoseThatAre) {
  EndpointOptions options = options_of(1, {pipeline_of(offload_stages())});
  options.pipelines[0].policy = "down_sampel";
  try {
    Endpoint endpoint(std::move(options), TimePoint{});
    FAIL() << "it was accepted";
  } catch (const std::invalid_argument& e) {
    EXPECT_THAT(e.what(), HasSubstr("'down_sampel' is not registered; there are "));
    EXPECT_THAT(e.what(), HasSubstr("down_sampling"));
  }
}

}  // namespace
}  // namespace interneuron::submit_test
