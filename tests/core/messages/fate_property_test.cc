// Over random delays, rates, losses, reordering, cuts, unplugged links, restarts, jumps of the
// receiver's clock, budgets and cancellations: every accepted message has exactly one fate, in
// time; what the fate says is what the other end saw; nothing is delivered twice in one life of the
// receiver, or after its deadline; and no more memory is held than may be.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cstring>
#include <random>
#include <set>

#include "door.h"
#include "interneuron/sizes.h"

namespace interneuron::fate_property_test {
namespace {

// The number of a message stands in its first bytes.
Bytes numbered(std::uint32_t number, std::size_t bytes) {
  Bytes out(std::max(bytes, sizeof(number)));
  std::memcpy(out.data(), &number, sizeof(number));
  return out;
}

std::uint32_t number_of(const Bytes& bytes) {
  std::uint32_t number = 0;
  std::memcpy(&number, bytes.data(), sizeof(number));
  return number;
}

// What messages under way, and incomplete ones, may hold at most.
constexpr std::size_t kSendBudget = 300'000;
// The longest that packets wait for others on their way, and take without that, one way.
constexpr Duration kMostQueue = 20ms;
constexpr Duration kMostDelay = 40ms;

EndpointOptions road_options(std::uint32_t session, std::size_t budget) {
  EndpointOptions options = options_of(session);
  options.reassembly_budget_bytes = budget;
  return options;
}

EndpointOptions vehicle_options() {
  EndpointOptions options = options_of(1, {}, false);
  options.send_budget_bytes = kSendBudget;
  return options;
}

class Storm {
 public:
  explicit Storm(std::uint32_t seed)
      : rng_(seed),
        road_budget_(chance(0.5) ? 60'000 : 1'000'000),
        door_(1h, road_options(2, road_budget_), vehicle_options()) {
    loss_ = uniform(0, 25) / 100.0;
    jitter_ = std::chrono::milliseconds(uniform(0, 15));
    for (const LinkId link : {kFast, kSlow}) {
      door_.pipe.delay[link] = std::chrono::milliseconds(uniform(1, 40));
      rate_[link] = DataRate{uniform(1, 50) * 1'000'000LL};
    }
    door_.pipe.spins_allowed = 1;
    door_.pipe.drop = [this](std::size_t from, LinkId link, ByteView bytes) {
      waits_ = {};
      if (chance(loss_)) return true;
      if (from != door_.vehicle) return false;
      const Duration air = rate_.at(link).transmit_time(bytes.size() + kIpUdpBytes);
      const Duration free_at = std::max(free_at_[link], door_.pipe.now()) + air;
      if (free_at - door_.pipe.now() > kMostQueue) return true;
      free_at_[link] = free_at;
      waits_ = free_at - door_.pipe.now();
      return false;
    };
    door_.pipe.jitter = [this] {
      return waits_ + Duration{uniform(0, static_cast<int>(jitter_.count()))};
    };
    // What was learnt before is of other links.
    door_.pipe.run(3s);
  }

  void blow() {
    for (int step = 0; step < 200; ++step) {
      if (chance(0.5)) send();
      if (chance(0.02)) cut(kFast);
      if (chance(0.02)) cut(kSlow);
      if (chance(0.05) && !accepted_.empty()) cancel();
      if (chance(0.003)) restart();
      if (chance(0.01)) unplug();
      if (chance(0.005)) jump();
      door_.pipe.run(std::chrono::milliseconds(uniform(1, 20)));
      RC_ASSERT(door_.pipe.at(door_.vehicle).sending_bytes() <= kSendBudget);
      RC_ASSERT(door_.pipe.at(door_.road).reassembly_bytes() <= road_budget_);
    }
    door_.pipe.cut.clear();
    door_.pipe.run(2s);
  }

  void check() {
    std::set<std::uint32_t> came;
    std::set<std::pair<int, std::uint32_t>> came_in_life;
    for (const Door::Came& c : door_.came) {
      const std::uint32_t number = number_of(c.what.bytes);
      // What an earlier life of the receiver had it cannot know.
      RC_ASSERT(came_in_life.emplace(c.life, number).second);
      came.insert(number);
      const Door::Sent& sent = door_.sent.at(numbers_.at(number));
      // Without the sender's clock nobody can tell; with it, as well as it is known.
      if (c.what.age) RC_ASSERT(c.at - sent.at <= sent.deadline + c.what.age_error + 1ms);
    }
    for (const auto& [number, id] : numbers_) {
      const Door::Sent& sent = door_.sent.at(id);
      RC_ASSERT(door_.fates[id].size() == 1U);
      const auto& [fate, told_at] = door_.fates[id].front();
      const Duration after = told_at - (sent.at + sent.deadline);
      RC_ASSERT(after <= 50ms + round_trip_most() + 1ms);
      if (fate.fate == Fate::kDelivered) RC_ASSERT(came.contains(number));
      // What one life of the receiver refused may reach the next one by another link; and where it
      // forgot us because its clock jumped by a minute, it does not know what it had delivered.
      const auto between = [this, from = sent.at, at = told_at](Duration r) {
        return r >= from && r <= at + round_trip_most();
      };
      const bool same_life = std::ranges::none_of(restarts_, between) &&
                             std::ranges::none_of(door_.forgotten, between);
      const bool never_came = fate.fate == Fate::kLate || (fate.fate == Fate::kDropped &&
                                                           fate.reason != FateReason::kCancelled);
      if (never_came && same_life) RC_ASSERT(!came.contains(number));
      RC_ASSERT((fate.fate == Fate::kDropped) <= (fate.reason != FateReason::kNone));
    }
    RC_ASSERT(door_.fates.size() == numbers_.size());
  }

 private:
  Duration round_trip_most() const { return 2 * (kMostDelay + jitter_) + kMostQueue; }
  int uniform(int from, int to) { return std::uniform_int_distribution<int>(from, to)(rng_); }
  bool chance(double p) { return std::bernoulli_distribution(p)(rng_); }

  void send() {
    const auto number = static_cast<std::uint32_t>(next_++);
    Variants variants{numbered(number, static_cast<std::size_t>(uniform(4, 30'000)))};
    if (chance(0.3)) variants.push_back(numbered(number, 500));
    SendOptions options;
    options.deadline = std::chrono::milliseconds(uniform(15, 200));
    options.policy = chance(0.5) ? "down_sampling" : "duplicate";
    options.channel = static_cast<std::uint16_t>(uniform(0, 2));
    options.newest_only = options.channel == 2;
    const SendResult result = door_.send(std::move(variants), options);
    if (!result.accepted()) return;
    numbers_[number] = result.id;
    accepted_.push_back(result.id);
  }
  void cut(LinkId link) {
    if (door_.pipe.cut.erase(link) == 0) door_.pipe.cut.insert(link);
  }
  void cancel() {
    const auto at = static_cast<std::size_t>(uniform(0, static_cast<int>(accepted_.size()) - 1));
    door_.pipe.at(door_.vehicle).cancel(door_.pipe.local(door_.vehicle), accepted_[at]);
    door_.pipe.flush(door_.vehicle);
  }
  void restart() {
    ++door_.lives;
    restarts_.push_back(door_.pipe.now());
    const auto session = static_cast<std::uint32_t>(uniform(100, 1 << 30));
    door_.pipe.restart(door_.road, road_options(session, road_budget_));
  }
  // The clock of the receiver goes forward by anything from a millisecond to hours. Back it only
  // goes for the host: the endpoint's own time does not.
  void jump() {
    const std::uint64_t most = std::uint64_t{1} << uniform(0, 24);
    const std::chrono::milliseconds by(1 + static_cast<std::int64_t>(rng_() % most));
    door_.pipe.jump(door_.road, by);
  }
  // The NIC of a link of the vehicle goes, and comes back after some time.
  void unplug() {
    const LinkId link = chance(0.5) ? kFast : kSlow;
    if (!unplugged_.insert(link).second) return;
    Endpoint& vehicle = door_.pipe.at(door_.vehicle);
    vehicle.remove_link(door_.pipe.local(door_.vehicle), link);
    door_.pipe.flush(door_.vehicle);
    door_.pipe.plan(std::chrono::milliseconds(uniform(10, 300)), [this, link] {
      const TimePoint now = door_.pipe.local(door_.vehicle);
      door_.pipe.at(door_.vehicle).add_link(now, link, {"nic", 1500});
      door_.pipe.at(door_.vehicle).add_path(now, door_.peer, link, address_of(door_.road));
      door_.pipe.flush(door_.vehicle);
      unplugged_.erase(link);
    });
  }

  std::mt19937 rng_;
  std::size_t road_budget_ = 0;
  double loss_ = 0;
  std::map<LinkId, DataRate> rate_;
  std::map<LinkId, Duration> free_at_;
  std::set<LinkId> unplugged_;
  std::vector<Duration> restarts_;
  Duration waits_{};
  Duration jitter_{};
  std::uint32_t next_ = 0;
  std::map<std::uint32_t, SendId> numbers_;
  std::vector<SendId> accepted_;
  // Last, because it calls what stands above.
  Door door_;
};

RC_GTEST_PROP(FateProperty, EveryMessageHasExactlyOneAndItIsTrue, ()) {
  Storm storm(*rc::gen::arbitrary<std::uint32_t>());
  storm.blow();
  storm.check();
}

}  // namespace
}  // namespace interneuron::fate_property_test
