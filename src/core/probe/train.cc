#include "core/probe/summary.h"

#include <algorithm>
#include <cmath>

namespace interneuron::probe {
namespace {

// How much longer than kTrainMinDispersion the next train is to take, because the rate that its
// length follows from is only roughly known. No measurement behind this value: it only has to be
// larger than the usual error of a short train.
constexpr double kLengthMargin = 1.6;
// From which dispersion on a train of kTrainMaxPackets is believed.
constexpr Duration kLongestTrainDispersion = std::chrono::milliseconds(1);

// The rate of the packets behind the lead-in; 0 when they are too few.
DataRate rough_rate(const std::vector<std::int64_t>& sorted_ns, std::size_t ip_bytes) {
  if (sorted_ns.size() < kTrainLeadIn + 2) return {};
  const std::int64_t took = sorted_ns.back() - sorted_ns[kTrainLeadIn];
  return rate_of((sorted_ns.size() - kTrainLeadIn - 1) * ip_bytes, Duration{took});
}

}  // namespace

std::optional<DataRate> dispersion_rate(std::vector<std::int64_t> arrivals_ns, std::size_t ip_bytes,
                                        std::size_t train_packets) {
  std::ranges::sort(arrivals_ns);
  // A tenth may be missing: on a lossy path nothing else would come of it.
  if (arrivals_ns.size() < kTrainLeadIn + 2 ||
      arrivals_ns.size() * 10 < (kTrainLeadIn + kTrainMinPackets) * 9) {
    return std::nullopt;
  }
  const Duration took{arrivals_ns.back() - arrivals_ns[kTrainLeadIn]};
  const Duration least =
      train_packets >= kTrainMaxPackets ? kLongestTrainDispersion : kTrainMinDispersion;
  if (took < least) return std::nullopt;
  return rough_rate(arrivals_ns, ip_bytes);
}

std::size_t train_length(DataRate rate, std::size_t ip_bytes) {
  const double bits = kLengthMargin * static_cast<double>(rate.bits_per_second) *
                      static_cast<double>(kTrainMinDispersion.count()) / 1e9;
  const double packets = std::ceil(bits / (8.0 * static_cast<double>(ip_bytes)));
  const double needed = std::max(packets, static_cast<double>(kTrainMinPackets)) + kTrainLeadIn + 1;
  return static_cast<std::size_t>(std::min(needed, static_cast<double>(kTrainMaxPackets)));
}

TrainRates rates_of(std::span<const SentPacket> train, std::size_t ip_bytes, bool held) {
  std::vector<std::int64_t> there;
  std::vector<std::int64_t> back;
  for (const SentPacket& packet : train) {
    if (!packet.answered) continue;
    there.push_back((packet.sent.time_since_epoch() + packet.up).count());
    back.push_back(packet.received.time_since_epoch().count());
  }
  TrainRates rates;
  rates.up = dispersion_rate(there, ip_bytes, train.size());
  std::ranges::sort(there);
  rates.rough = rough_rate(there, ip_bytes);
  if (held) {
    rates.down = dispersion_rate(back, ip_bytes, train.size());
    std::ranges::sort(back);
    rates.rough = std::max(rates.rough, rough_rate(back, ip_bytes));
  }
  return rates;
}

std::optional<DataRate> median(std::vector<DataRate> rates) {
  if (rates.empty()) return std::nullopt;
  const auto middle = rates.begin() + static_cast<std::ptrdiff_t>((rates.size() - 1) / 2);
  std::ranges::nth_element(rates, middle);
  return *middle;
}

}  // namespace interneuron::probe
