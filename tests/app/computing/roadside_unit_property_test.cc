#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "support.h"

namespace interneuron::computing::roadside_unit_property_test {
namespace {

using std::chrono::milliseconds;

// A unit beside a model of what each job has come to, driven in virtual time.
class Model {
 public:
  explicit Model(std::optional<std::size_t> top_level) : unit_(three_levels(), top_level) {}

  void pass(Duration time) { now_ += time; }

  void hand_over(std::uint32_t peer, Duration deadline) {
    const std::uint32_t round = next_round_++;
    jobs_[round] = {peer, now_, deadline, 0, 0};
    unit_.add(job_of(peer, round, now_, deadline));
    drain();
    RC_ASSERT(waiting_of(peer) <= UnitRules{}.waiting_per_peer);
  }

  // The level is any that the unit offers.
  void take(std::size_t any) {
    const Unit::Job* next = unit_.next(now_);
    drain();
    if (next == nullptr) return;
    RC_ASSERT(!running_);
    const std::uint32_t round = next->message.round.round.value;
    const Fate& fate = jobs_.at(round);
    RC_ASSERT(!fate.ended());
    RC_ASSERT(now_ - fate.delivered <= fate.deadline);
    for (const auto& [other, of] : jobs_) {
      if (of.peer == fate.peer && !of.ended()) RC_ASSERT(of.due() >= fate.due());
    }
    const std::size_t level = any % unit_.levels(PeerId{fate.peer}, now_).size();
    RC_ASSERT(unit_.begin(now_, level).input == static_cast<int>(round));
    running_ = round;
    level_ = level;
  }

  void finish(bool good) {
    if (!running_) return;
    const std::uint32_t round = *std::exchange(running_, std::nullopt);
    if (!good) {
      unit_.fail(now_);
      return drain();
    }
    const Computed computed = unit_.end(now_, 20ms);
    RC_ASSERT(computed.round.round.value == round);
    RC_ASSERT(computed.level == level_);
    RC_ASSERT(computed.delivered <= computed.began && computed.began <= computed.ended);
    ++jobs_.at(round).computed;
  }

  // Each job was computed or told, once, and the unit counts alike.
  void check_the_end() {
    finish(true);
    pass(1h);
    RC_ASSERT(unit_.next(now_) == nullptr);
    drain();
    RC_ASSERT(unit_.waiting() == 0u);
    std::uint64_t computed = 0;
    for (const auto& [round, fate] : jobs_) {
      RC_ASSERT(fate.computed + fate.told == 1);
      computed += static_cast<std::uint64_t>(fate.computed);
    }
    RC_ASSERT(unit_.total().computed == computed);
    RC_ASSERT(unit_.total().computed + unit_.total().unanswered() == jobs_.size());
  }

  const Unit& unit() const { return unit_; }

 private:
  struct Fate {
    std::uint32_t peer = 0;
    TimePoint delivered{};
    Duration deadline{};
    int computed = 0;
    int told = 0;
    bool ended() const { return computed + told > 0; }
    TimePoint due() const { return delivered + deadline; }
  };

  void drain() {
    for (const Unanswered& one : unanswered(unit_)) {
      Fate& fate = jobs_.at(one.round.round.value);
      RC_ASSERT(one.from == PeerId{fate.peer});
      ++fate.told;
    }
  }
  std::size_t waiting_of(std::uint32_t peer) const {
    return static_cast<std::size_t>(std::ranges::count_if(jobs_, [&](const auto& entry) {
      return entry.second.peer == peer && !entry.second.ended() && running_ != entry.first;
    }));
  }

  Unit unit_;
  TimePoint now_{};
  std::uint32_t next_round_ = 0;
  std::map<std::uint32_t, Fate> jobs_;
  std::optional<std::uint32_t> running_;
  std::size_t level_ = 0;
};

RC_GTEST_PROP(RoadsideUnit, EveryJobEndsExactlyOnceInTimeOrIsTold, ()) {
  std::optional<std::size_t> top_level;
  if (*rc::gen::arbitrary<bool>()) top_level = *rc::gen::inRange<std::size_t>(0, 5);
  Model model(top_level);
  const auto steps = *rc::gen::container<std::vector<std::pair<int, int>>>(
      rc::gen::pair(rc::gen::inRange(0, 8), rc::gen::inRange(0, 200)));
  for (const auto& [what, amount] : steps) {
    if (what == 0) model.pass(milliseconds(amount));
    if (what >= 1 && what <= 3) {
      model.hand_over(static_cast<std::uint32_t>(what % 2), milliseconds(amount));
    }
    if (what == 4 || what == 5) model.take(static_cast<std::size_t>(amount));
    if (what >= 6) model.finish(what == 6);
    if (top_level) {
      RC_ASSERT(model.unit().levels().size() <= *top_level + 1);
      RC_ASSERT(model.unit().top_level(PeerId{}, milliseconds(amount)) <= *top_level);
    }
    RC_ASSERT(model.unit().top_level(PeerId{}, milliseconds(amount)) <
              model.unit().levels().size());
  }
  model.check_the_end();
}

}  // namespace
}  // namespace interneuron::computing::roadside_unit_property_test
