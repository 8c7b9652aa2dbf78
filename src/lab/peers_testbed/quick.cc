#include "lab/peers_testbed/comparison.h"

namespace interneuron::peers_testbed {
namespace {

using namespace std::chrono_literals;
using Names = std::vector<std::string_view>;

// How long messages begin. No measurement behind these values: all runs together, each with what it
// takes beside its messages, have to stay below 25 minutes.
constexpr Duration kLength = 8s;
// Where what is missed is compared most closely: 200 messages. A hole of 5 s begins in the middle.
constexpr Duration kJudgedLength = 20s;
// Large messages come less often.
constexpr Duration kLargeLength = 12s;

constexpr std::size_t kSmall = kSizes[0];
constexpr std::size_t kMedium = kSizes[1];
constexpr std::size_t kLarge = kSizes[2];
constexpr Duration kDeadline = kDeadlines.front();
// A message of 1,000,000 bytes takes 140 ms over the first link alone.
constexpr Duration kLargeDeadline = kDeadlines.back();

// Without those that were worse than their like on every link: TCP with CUBIC, SRT over both links.
const Names kQuickPeers{"ours_coded", "ours_stripe",   "ours_shadow",   "ours_failover",
                        "udp",        "udp_duplicate", "tcp_bbr",       "mptcp",
                        "mptcp_bbr",  "srt_backup",    "fastdds_stock", "fastdds_tuned"};
// The best of their kinds with losses.
const Names kFew{"ours_coded", "udp_duplicate", "mptcp_bbr", "srt_backup", "fastdds_tuned"};

std::vector<const Peer*> peers_of(const Names& names) {
  std::vector<const Peer*> out;
  for (const std::string_view name : names) out.push_back(peer_of(name));
  return out;
}

Choice choice_of(std::string_view scenario, std::size_t bytes, const Names& peers,
                 std::vector<Duration> deadlines, Duration length) {
  return Choice{.scenarios = {scenario_of(scenario)},
                .peers = peers_of(peers),
                .sizes = {bytes},
                .deadlines = std::move(deadlines),
                .length = length};
}

}  // namespace

std::vector<Run> quick_runs(std::uint64_t seed) {
  const std::vector<Duration> all(kDeadlines.begin(), kDeadlines.end());
  std::vector<Run> out;
  for (Choice choice : {
           choice_of("clean", kMedium, kQuickPeers, {kDeadline}, kJudgedLength),
           choice_of("loss", kSmall, kFew, {kDeadline}, kLength),
           choice_of("loss", kMedium, kQuickPeers, {kDeadline}, kJudgedLength),
           choice_of("loss", kLarge, kFew, {kLargeDeadline}, kLargeLength),
           choice_of("bursts", kMedium, kQuickPeers, {kDeadline}, kLength),
           choice_of("hole", kMedium, kQuickPeers, {kDeadline}, kJudgedLength),
           choice_of("drive-5g-4g", kMedium, kQuickPeers, {kDeadline}, kLength),
           choice_of("drive-lte-town", kMedium, kFew, all, kLength),
       }) {
    choice.seed = seed;
    const std::vector<Run> runs = runs_of(choice);
    out.insert(out.end(), runs.begin(), runs.end());
  }
  return out;
}

}  // namespace interneuron::peers_testbed
