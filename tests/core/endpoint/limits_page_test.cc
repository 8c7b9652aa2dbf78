// The figures of docs/limits.md are those of the code.
#include "tests/limits_page.h"

#include <gtest/gtest.h>

#include <set>

#include "core/base/held_memory.h"
#include "core/messages/books.h"
#include "interneuron/endpoint_options.h"
#include "interneuron/ledger.h"

namespace interneuron::limits_page_test {
namespace {

using messages::SentMessages;

using namespace limits_page;

TEST(LimitsPage, HasTheDefaultsOfTheCode) {
  const PeerLimits own;
  const std::map<std::string, std::string> expected{
      {"contexts", grouped(own.contexts)},
      {"pipelines", grouped(own.pipelines)},
      {"held_messages", grouped(own.held_messages)},
      {"ordered_messages", grouped(own.ordered_messages)},
      {"longest_deadline", seconds(own.longest_deadline)},
      {"reassembly_messages", grouped(own.reassembly_messages)},
      {"reassembly_bytes", mebibytes(own.reassembly_bytes)},
      {"round_bytes", mebibytes(own.round_bytes)},
      {"plain_bytes", mebibytes(own.plain_bytes)},
      {"channel_bytes", own.channel_bytes.empty() ? "none" : "some"},
      {"packets_per_second", grouped(own.packets_per_second)},
      {"messages_per_second", grouped(own.messages_per_second)},
      {"reassembly_budget_bytes", mebibytes(EndpointOptions{}.reassembly_budget_bytes)},
      {"HeldMemory::kBudgetBytes", mebibytes(HeldMemory::kBudgetBytes)},
      {"SentMessages::kMaxMessages", grouped(SentMessages::kMaxMessages)}};
  EXPECT_EQ(figures_of("/docs/limits.md", 0), expected);
}

// What the ledger calls the limits, in the last column.
TEST(LimitsPage, NamesEachLimitAsTheLedgerDoes) {
  std::set<std::string> expected;
  for (std::size_t i = 0; i < kPeerLimitCount; ++i) {
    expected.emplace(to_string(static_cast<PeerLimit>(i)));
  }
  std::set<std::string> named;
  for (const auto& [name, figure] : figures_of("/docs/limits.md", 3)) named.insert(name);
  EXPECT_EQ(named, expected);
}

}  // namespace
}  // namespace interneuron::limits_page_test
