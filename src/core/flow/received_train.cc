#include "core/flow/received_train.h"

#include <algorithm>

#include "core/base/slow_link.h"
#include "interneuron/sizes.h"

namespace interneuron::flow {
namespace {

// A pause longer than this always ends a train: a full packet takes 114 ms at 0.1 Mbit/s, and one
// in between may be lost.
constexpr Duration kLongestGap = std::chrono::milliseconds(300);
// A train longer than this measures the source and not the link, or an average over a change of the
// rate. No measurement behind this value: it only has to be larger than what a message takes to
// arrive.
constexpr Duration kMaxTrain = std::chrono::milliseconds(200);
// A slow link may take longer for so many packets, but not longer than kMaxSlowTrain.
constexpr std::uint32_t kSlowTrainPackets = 8;
constexpr Duration kMaxSlowTrain = std::chrono::seconds(1);
// A train that is shorter than both says nothing yet (RateEstimator): it goes on whatever pause
// follows.
constexpr std::uint32_t kToldPackets = 16;
constexpr Duration kTold = std::chrono::milliseconds(5);
// Where the last packet of a few is short, its gap is: they come evenly all the same where no byte
// took longer than this times the mean, which is what the rule for packets of one size allows three
// of them.
constexpr double kEven = 4.0 / 3;
constexpr std::uint32_t kLeastEven = 3;

// A gap between packets that left at once is the link's, which is not granted all the time, where
// it is longer than this and the grant brings kGrantPackets.
constexpr Duration kLeastUngranted = std::chrono::milliseconds(2);

// Packets come evenly until a byte takes so many times as long as those before, which is less than
// the pace of a train may be above a rate that is believed (RateEstimator::kHeadroom) and a fifth
// too high, or until one takes so much less.
constexpr double kSlower = 1.4;
constexpr double kFaster = 2.5;
// A token bucket has run empty within a train where so many packets at its end came evenly, for
// kTold at the least, and those before this many times as fast as they. Their rate is what the
// bucket is filled at, and that of the others nobody's. No measurement behind the first value; the
// second is more than trains of one rate differ by (15 %).
constexpr std::uint32_t kDrainedPackets = 6;
constexpr double kBurst = 1.4;
// The packets at its end left in this share of the time that they took, with those that were
// dropped among them: else it is the sender who was slow.
constexpr double kHeldBack = 0.75;

}  // namespace

void ReceivedTrain::begin(TimePoint now, std::uint64_t number) {
  *this = {.start = number, .packets = 1, .first = now, .last = now, .newest = number};
}

void ReceivedTrain::add(TimePoint now, std::uint64_t number, std::size_t ip_bytes, Duration apart,
                        Duration pause) {
  const Duration gap = now - last;
  if (gap > kLeastUngranted && pause < gap / 2) {
    last_end = {last, bytes};
    if (grants == 0) first_end = last_end;
    longest_ungranted = std::max<Duration>(longest_ungranted, gap);
    ungranted += gap;
    ++grants;
  }
  ++packets;
  bytes += ip_bytes;
  longest_gap = std::max<Duration>(longest_gap, gap);
  most_ns_per_byte =
      std::max(most_ns_per_byte, static_cast<double>(gap.count()) / static_cast<double>(ip_bytes));
  sent += apart;
  add_steady(number, ip_bytes, gap, apart);
  newest = std::max(newest, number);
  last = now;
}

void ReceivedTrain::add_steady(std::uint64_t number, std::size_t ip_bytes, Duration gap,
                               Duration apart) {
  const double pace = static_cast<double>(gap.count()) / static_cast<double>(ip_bytes);
  const double before = static_cast<double>(steady.took.count()) /
                        static_cast<double>(std::max<std::size_t>(steady.bytes, 1));
  if (pace > kSlower * before || before > kFaster * pace) steady = {};
  ++steady.packets;
  steady.bytes += ip_bytes;
  steady.took += gap;
  const std::uint64_t left = number > newest ? number - newest : 1;
  steady.sent += apart / static_cast<std::int64_t>(left);
}

// Where the link was not granted all the time, the train may have begun and ended anywhere between
// two grants. From the end of one grant to that of another the rate is exact, where they come
// regularly and a long time apart: a NIC that serves many peers in turns pauses for some 20 ms,
// too. Else half a gap more is right in the mean. A train that took no longer than it left and one
// such half shows how fast it left, and of the link that it carries that; one that took no longer
// than it left and a gap may show either.
DataRate ReceivedTrain::mean_rate() const {
  Duration took = last - first;
  const Duration gap = mean_ungranted();
  if (gap < kGrantPackets * mean_gap() || gap == Duration::zero()) return rate_of(bytes, took);
  if (spans_grants() && gap > kLongestUngranted && took > sent) {
    return rate_of(last_end.bytes - first_end.bytes, last_end.at - first_end.at);
  }
  if (took <= sent + gap / 2) {
    took = std::min(took, sent);
  } else if (took > sent + gap) {
    took += gap / 2;
  }
  return rate_of(bytes, took);
}

DataRate ReceivedTrain::rate() const {
  const DataRate mean = mean_rate();
  const bool held_back = static_cast<double>(steady.sent.count()) <=
                         kHeldBack * static_cast<double>(steady.took.count());
  if (steady.packets < kDrainedPackets || steady.took < kTold || !held_back) return mean;
  const DataRate drained = rate_of(steady.bytes, steady.took);
  const DataRate burst = rate_of(bytes - steady.bytes, last - first - steady.took);
  return burst > drained.scaled(kBurst) ? std::min(mean, drained) : mean;
}

bool ReceivedTrain::ends(TimePoint now, Duration pause) const {
  if (packets == 0 || closed) return true;
  const Duration gap = now - last;
  if (gap > kLongestGap) return true;
  const Duration length = now - first;
  if (length > kMaxSlowTrain || (length > kMaxTrain && packets >= kSlowTrainPackets)) return true;
  const bool paused = pause > std::max<Duration>(kTrainGap, kPauseGaps * mean_gap());
  const bool told = packets >= kToldPackets || last - first >= kTold;
  return paused && told;
}

bool ReceivedTrain::even() const {
  if (packets >= kToldPackets || 3 * longest_gap <= 2 * (last - first)) return true;
  const double ns = static_cast<double>(Duration(last - first).count());
  return packets >= kLeastEven && most_ns_per_byte * static_cast<double>(bytes) <= kEven * ns;
}

// Over a slow path messages follow each other so closely that no pause between them is longer than
// four of their gaps: one train would go on over several of them and show what was sent. So would
// one of small packets, wherever it ended.
void ReceivedTrain::message_ends() {
  const bool is_large = 2 * bytes >= kMaxPacketBytes * (packets - 1);
  closed = is_large && even() && is_slow(rate_of(bytes, last - first));
}

}  // namespace interneuron::flow
