// Over random losses, reordering, cuts, restarts and cancellations: every accepted message has
// exactly one fate, in time; what the fate says is what the other end saw; nothing is delivered
// twice in one life of the receiver, or after its deadline.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cstring>
#include <random>
#include <set>

#include "door.h"

namespace interneuron {
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

class Storm {
 public:
  explicit Storm(std::uint32_t seed) : rng_(seed) {
    loss_ = uniform(0, 25) / 100.0;
    jitter_ = std::chrono::milliseconds(uniform(0, 15));
    door_.pipe.spins_allowed = 3;
    door_.pipe.drop = [this](std::size_t, LinkId, ByteView) { return chance(loss_); };
    door_.pipe.jitter = [this] { return Duration{uniform(0, static_cast<int>(jitter_.count()))}; };
  }

  void blow() {
    for (int step = 0; step < 200; ++step) {
      if (chance(0.5)) send();
      if (chance(0.02)) cut(kFast);
      if (chance(0.02)) cut(kSlow);
      if (chance(0.05) && !accepted_.empty()) cancel();
      if (chance(0.003)) restart();
      door_.pipe.run(std::chrono::milliseconds(uniform(1, 20)));
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
      // Round trips have 20 ms at most without what the jitter adds, both ways.
      const Duration after = told_at - (sent.at + sent.deadline);
      RC_ASSERT(after <= 50ms + 20ms + 2 * jitter_ + 1ms);
      if (fate.fate == Fate::kDelivered) RC_ASSERT(came.contains(number));
      if (fate.fate == Fate::kLate) RC_ASSERT(!came.contains(number));
      RC_ASSERT((fate.fate == Fate::kDropped) <= (fate.reason != FateReason::kNone));
    }
    RC_ASSERT(door_.fates.size() == numbers_.size());
  }

 private:
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
    door_.pipe.restart(door_.road, options_of(static_cast<std::uint32_t>(uniform(100, 1 << 30))));
  }

  std::mt19937 rng_;
  Door door_;
  double loss_ = 0;
  Duration jitter_{};
  std::uint32_t next_ = 0;
  std::map<std::uint32_t, SendId> numbers_;
  std::vector<SendId> accepted_;
};

RC_GTEST_PROP(FateProperty, EveryMessageHasExactlyOneAndItIsTrue, ()) {
  Storm storm(*rc::gen::arbitrary<std::uint32_t>());
  storm.blow();
  storm.check();
}

}  // namespace
}  // namespace interneuron
