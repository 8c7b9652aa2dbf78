// The tables for a page.
#include "lab/peers_testbed/comparison.h"

#include <gtest/gtest.h>

namespace interneuron::peers_testbed::page_test {
namespace {

using namespace std::chrono_literals;

Row row_of(const char* scenario, const char* peer, std::size_t bytes, std::size_t missed) {
  Row row{scenario_of(scenario), peer_of(peer), bytes, 100ms, 100ms, 1, 200};
  row.missed = missed;
  row.wire_ratio = 1.066;
  row.cpu_us_send = 220.4;
  return row;
}

TEST(Page, ConditionsOfTheSamePeersShareATable) {
  std::vector<Row> rows{
      row_of("clean", "ours_coded", 128 * 1024, 0), row_of("clean", "udp", 128 * 1024, 1),
      row_of("loss", "ours_coded", 5'000, 0), row_of("hole", "ours_coded", 128 * 1024, 0),
      row_of("hole", "udp", 128 * 1024, 51)};
  rows[0].cpu_us_receive = 1000;
  rows[3].degraded = 2;
  EXPECT_EQ(page_of(rows),
            "| | clean, 128 KiB, 100 ms, 200 messages | hole, 128 KiB, 100 ms, 200 messages |"
            " µs to send, to receive |\n"
            "|---|---|---|---|\n"
            "| `ours_coded` | 0, 1.07 | 0 (2), 1.07 | 220, 1000 |\n"
            "| `udp` | 1, 1.07 | 51, 1.07 | 220, – |\n"
            "\n"
            "| | loss, 5 KB, 100 ms, 200 messages | µs to send, to receive |\n"
            "|---|---|---|\n"
            "| `ours_coded` | 0, 1.07 | 220, – |\n");
}

TEST(Page, EachDeadlineIsAColumn) {
  std::vector<Row> rows(2, row_of("clean", "udp", 1'000'000, 3));
  rows[1].deadline = 300ms;
  rows[1].missed = 0;
  EXPECT_NE(page_of(rows).find("1000 KB, 100 ms, 200 messages | clean, 1000 KB, 300 ms"),
            std::string::npos);
  EXPECT_NE(page_of(rows).find("| `udp` | 3, 1.07 | 0, 1.07 |"), std::string::npos);
}

TEST(Page, WithoutRowsThereIsNone) { EXPECT_EQ(page_of({}), ""); }

}  // namespace
}  // namespace interneuron::peers_testbed::page_test
