#include "netns/verify/readings.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace interneuron::netns::verify {

namespace {

using Record = std::optional<Datagram>;

// A corrupted 32-bit number must not make a table of 4 * 10^9 entries. No measurement is behind
// this value: it only has to be larger than what verify sends, which is below 10^6 packets a flow.
constexpr std::uint32_t kMostPackets = 100'000'000;

std::uint32_t highest_number(const std::vector<Datagram>& records) {
  // Corruption hits single records, so a number that is this far above all before it is corrupted.
  // No run of lost packets is as long: verify sends fewer than that altogether.
  constexpr std::uint32_t kLargestGap = 1'000'000;
  std::uint32_t highest = 0;
  for (const Datagram& record : records) {
    if (record.number < kMostPackets && record.number < highest + kLargestGap) {
      highest = std::max(highest, record.number);
    }
  }
  return highest;
}

// Entry i is the first record seen of number i + 1 (iperf3 counts from 1); empty where there is
// none.
std::vector<Record> table_of(const std::vector<Datagram>& at_sender,
                             const std::vector<Datagram>& at_receiver, SentBy sent_by) {
  std::uint32_t highest = highest_number(at_sender);
  if (sent_by == SentBy::kStamp) highest = std::max(highest, highest_number(at_receiver));
  std::vector<Record> table(highest);
  const auto note = [&](const Datagram& record) {
    if (record.number < 1 || record.number > highest) return;
    Record& entry = table[record.number - 1];
    if (!entry) entry = record;
  };
  for (const Datagram& record : at_sender) note(record);
  if (sent_by == SentBy::kStamp) {
    for (const Datagram& record : at_receiver) note(record);
  }
  return table;
}

// One packet per number, from number `first` + 1 (the first that was seen) on, with the time at
// which it was sent.
std::vector<Flow::Packet> packets_of(const std::vector<Record>& table, std::size_t first,
                                     SentBy sent_by) {
  const auto time = [sent_by](const Datagram& d) {
    return sent_by == SentBy::kCapture ? d.seen : d.stamp;
  };
  std::vector<Flow::Packet> packets;
  packets.reserve(table.size() - first);
  std::size_t known = first;
  for (std::size_t i = first; i < table.size(); ++i) {
    if (!table[i]) continue;
    const Duration end = time(*table[i]);
    const Duration begin = packets.empty() ? end : packets.back().sent;
    const auto steps = static_cast<std::int64_t>(i - known);
    for (std::int64_t k = 1; k < steps; ++k) {
      packets.push_back({begin + (end - begin) * k / steps, table[i]->ip_bytes, std::nullopt});
    }
    // Two senders' clocks may differ by less than a reading; the order is that of the numbers.
    packets.push_back({std::max(begin, end), table[i]->ip_bytes, std::nullopt});
    known = i;
  }
  return packets;
}

}  // namespace

Flow match(const std::vector<Datagram>& at_sender, const std::vector<Datagram>& at_receiver,
           SentBy sent_by) {
  Flow flow;
  const std::vector<Record> table = table_of(at_sender, at_receiver, sent_by);
  const auto first = static_cast<std::size_t>(
      std::find_if(table.begin(), table.end(), [](const Record& r) { return r.has_value(); }) -
      table.begin());
  if (first == table.size()) {
    flow.foreign = at_receiver.size();
    return flow;
  }
  flow.packets = packets_of(table, first, sent_by);
  std::size_t highest = 0;
  for (const Datagram& record : at_receiver) {
    // A number below the first one wraps round to a large index; the check below refuses it.
    const std::size_t index = std::size_t{record.number} - 1 - first;
    if (record.number <= first || index >= flow.packets.size() ||
        (table[first + index] && table[first + index]->stamp != record.stamp)) {
      ++flow.foreign;
      continue;
    }
    Flow::Packet& packet = flow.packets[index];
    if (packet.arrived) {
      ++flow.duplicates;
      continue;
    }
    packet.arrived = record.seen;
    if (index < highest) ++flow.reordered;
    highest = std::max(highest, index);
  }
  return flow;
}

Flow trim(Flow flow, Duration from, Duration to) {
  std::erase_if(flow.packets, [&](const Flow::Packet& p) { return p.sent < from || p.sent >= to; });
  return flow;
}

Bursts bursts(const Flow& flow, const Schedule& schedule, Direction direction) {
  std::size_t runs = 0;
  std::size_t lost = 0;
  bool in_run = false;
  for (const Flow::Packet& packet : flow.packets) {
    const bool counts = !packet.arrived && schedule.loss(direction, packet.sent) < 1;
    if (counts) ++lost;
    if (counts && !in_run) ++runs;
    in_run = counts;
  }
  return {runs, runs == 0 ? 0 : static_cast<double>(lost) / static_cast<double>(runs)};
}

double chance_of_loss(double loss, const std::optional<emu::GilbertElliott>& chain,
                      std::size_t packets) {
  if (packets == 0) return 1;
  double variance = loss * (1 - loss);
  if (chain && chain->p > 0) {
    // Between packets k apart the covariance is (l1 - l0)^2 bad (1 - bad) (1 - p - r)^k.
    const double bad = chain->p / (chain->p + chain->r);
    const double decay = 1 - chain->p - chain->r;
    const double contrast = chain->loss_in_bad - chain->loss_in_good;
    variance += 2 * contrast * contrast * bad * (1 - bad) * decay / (1 - decay);
  }
  return std::sqrt(variance / static_cast<double>(packets));
}

double expected_burst(const emu::GilbertElliott& chain, double other, double others_per_packet) {
  const double sum = chain.p + chain.r;
  const double bad = sum > 0 ? chain.p / sum : 0;
  const std::array<double, 2> share{1 - bad, bad};
  const auto combined = [other](double loss) { return 1 - (1 - loss) * (1 - other); };
  const std::array<double, 2> loss{combined(chain.loss_in_good), combined(chain.loss_in_bad)};
  // After k moves a two-state chain has P(j | i) = share_j + (1_{ij} - share_j) (1 - p - r)^k.
  const double decay = 1 - sum;
  const double memory = (1 - others_per_packet) * decay + others_per_packet * decay * decay;
  double once = 0;
  double twice = 0;
  for (std::size_t i = 0; i < 2; ++i) {
    once += share[i] * loss[i];
    for (std::size_t j = 0; j < 2; ++j) {
      const double step = share[j] + ((i == j ? 1.0 : 0.0) - share[j]) * memory;
      twice += share[i] * loss[i] * step * loss[j];
    }
  }
  return once > twice ? once / (once - twice) : 0;
}

}  // namespace interneuron::netns::verify
