// Vehicles with cameras that share one cell: each message arrives in some variant, and the cell's
// queue stays short, from soon after the last one has joined.
#include <gtest/gtest.h>

#include <cstring>
#include <map>
#include <numeric>
#include <random>
#include <vector>

#include "interneuron/policy.h"
#include "lab/emu/link.h"
#include "lab/sim/trust.h"
#include "lab/sim/world.h"
#include "support.h"

namespace interneuron::sim::crowd_test {
namespace {

constexpr double kCellMbit = 60;
constexpr Duration kPeriod = 100ms;
constexpr Duration kLongestQueue = 300ms;

struct Crowd {
  int vehicles = 0;
  // What all ask for in their best variants, in terms of the cell's rate.
  double load = 0;
  Duration joins_apart{};
  bool has_variants = true;
};

// What came of the messages of a crowd.
class Cell {
 public:
  Cell(const Crowd& crowd, std::uint64_t seed, Duration length)
      : crowd_(crowd), world_(seed), got_(static_cast<std::size_t>(crowd.vehicles)) {
    std::vector<int> keys(got_.size());
    std::iota(keys.begin(), keys.end(), 2);
    EndpointOptions options;
    options.policies = builtin_policies();
    options.session = SessionId{1U << 30U};
    options.accept_peers = true;
    options.max_peers = got_.size() + 1;
    options.security = security_of(1, keys);
    road_ = world_.add_host(std::move(options));
    const DataRate rate = DataRate::mbit(kCellMbit);
    cell_ =
        world_.add_cell({.rate = rate, .queue_bytes = emu::queue_bytes_of(rate, kLongestQueue)});
    world_.on_event([this](HostId host, Event&& e) {
      const auto* m = std::get_if<Message>(&e);
      if (m == nullptr || host != road_) return;
      std::uint32_t label[2];
      std::memcpy(label, m->bytes.data(), sizeof label);
      got_[label[0]][label[1]] = m->variant;
    });
    std::mt19937_64 phases(seed);
    for (std::uint32_t v = 0; v < got_.size(); ++v) join(v, keys[v], phases, length);
    const Duration all_there = crowd.joins_apart * crowd.vehicles + 300ms + 2s;
    world_.run_until(all_there);
    world_.measure_cells();
    world_.run_until(all_there + length);
  }

  // The share of the messages of [from, to) of each vehicle's time that came in some variant.
  double arrived(std::uint32_t from, std::uint32_t to) const {
    double all = 0;
    for (const auto& messages : got_) {
      all +=
          static_cast<double>(std::distance(messages.lower_bound(from), messages.lower_bound(to)));
    }
    return all / (static_cast<double>(got_.size()) * (to - from));
  }
  // Jain's index of the bytes that came.
  double fairness(std::uint32_t from) const {
    double sum = 0;
    double squares = 0;
    for (const auto& messages : got_) {
      double bytes = 0;
      for (auto it = messages.lower_bound(from); it != messages.end(); ++it) {
        bytes += it->second == 0 ? 4 : 1;
      }
      sum += bytes;
      squares += bytes * bytes;
    }
    return sum * sum / (squares * static_cast<double>(got_.size()));
  }
  double queue_p99_ms() const { return to_ms(world_.cell(cell_).queue_time().quantile(0.99)); }

 private:
  void join(std::uint32_t v, int key, std::mt19937_64& phases, Duration length) {
    EndpointOptions options;
    options.policies = builtin_policies();
    options.session = SessionId{v + 1};
    options.security = security_of(key, {1});
    const HostId host = world_.add_host(std::move(options));
    const WireId wire = world_.add_link(host, road_, LinkId{0}, "modem",
                                        emu::Link(constant_link("modem", 40, 1000, 1000), v + 1));
    world_.pass_through(wire, true, cell_);
    const Duration joins = crowd_.joins_apart * static_cast<int>(v);
    world_.at(joins, [this, host] {
      peers_[host] = world_.connect(host, road_);
      world_.flush(host);
    });
    const auto bytes =
        static_cast<std::size_t>(kCellMbit * 1e6 / 8 * to_seconds(kPeriod) * crowd_.load /
                                 static_cast<double>(got_.size()) / 1.066);
    const Duration first =
        joins + 300ms +
        Duration{std::uniform_int_distribution<std::int64_t>(0, kPeriod.count())(phases)};
    const Duration end = crowd_.joins_apart * crowd_.vehicles + 300ms + 2s + length - 200ms;
    std::uint32_t number = 0;
    for (Duration at = first; at < end; at += kPeriod) {
      world_.at(at, [this, host, v, bytes, n = number++] { send(host, v, n, bytes); });
    }
  }

  void send(HostId host, std::uint32_t v, std::uint32_t number, std::size_t bytes) {
    Variants variants;
    variants.emplace_back(bytes);
    if (crowd_.has_variants) variants.emplace_back(bytes / 4);
    const std::uint32_t label[2] = {v, number};
    for (Bytes& variant : variants) std::memcpy(variant.data(), label, sizeof label);
    SendOptions options;
    options.deadline = 150ms;
    options.policy = crowd_.has_variants ? "down_sampling" : "best_link";
    world_.endpoint(host).send(world_.local_time(host), peers_.at(host), std::move(variants),
                               options);
    world_.flush(host);
  }

  Crowd crowd_;
  World world_;
  HostId road_ = 0;
  CellId cell_{};
  std::map<HostId, PeerId> peers_;
  // The variant in which each message came, by vehicle.
  std::vector<std::map<std::uint32_t, std::uint8_t>> got_;
};

// Twice what the cell carries, whatever the vehicles know of it and of each other.
TEST(Crowds, OfCamerasSettleWithinTwoSeconds) {
  const Duration length = kSanitized ? 3s : 12s;
  for (const Duration apart : {5ms, 50ms}) {
    const Cell cell({.vehicles = 20, .load = 2, .joins_apart = apart}, 70011, length);
    const auto last = static_cast<std::uint32_t>(length / kPeriod) + 15;
    EXPECT_GE(cell.arrived(20, last), 0.98) << to_ms(apart);
    EXPECT_LE(cell.queue_p99_ms(), 90) << to_ms(apart);
    EXPECT_GE(cell.fairness(20), kSanitized ? 0.5 : 0.9) << to_ms(apart);
  }
}

}  // namespace
}  // namespace interneuron::sim::crowd_test
