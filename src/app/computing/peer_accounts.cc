#include "app/computing/peer_accounts.h"

#include <algorithm>
#include <cassert>
#include <utility>

#include "core/base/statistics.h"

namespace interneuron::computing {

LevelTimes::LevelTimes(std::vector<LevelProfile> levels)
    : levels_(std::move(levels)), runs_(levels_.size()) {
  assert(!levels_.empty());
}

void LevelTimes::learn(std::size_t level, Duration took) {
  assert(level < levels_.size());
  Ring<Duration>& runs = runs_[level];
  runs.push_back(took);
  if (runs.size() > kRemembered) runs.pop_front();
}

Duration LevelTimes::p95(std::size_t level) const {
  assert(level < levels_.size());
  const Ring<Duration>& runs = runs_[level];
  if (runs.size() < kFewest) return levels_[level].p95;
  std::vector<Duration> times;
  for (std::size_t i = 0; i < runs.size(); ++i) times.push_back(runs[i]);
  return std::max(levels_[level].p95, percentile(std::move(times), 0.95));
}

Duration LevelTimes::least() const {
  Duration least = levels_.front().median;
  const Ring<Duration>& runs = runs_.front();
  for (std::size_t i = 0; i < runs.size(); ++i) least = std::min(least, runs[i]);
  return least;
}

std::size_t LevelTimes::highest_within(Duration time) const {
  std::size_t highest = 0;
  for (std::size_t level = 0; level < levels_.size(); ++level) {
    if (p95(level) <= time) highest = level;
  }
  return highest;
}

PeerAccounts::PeerAccounts(std::vector<LevelProfile> levels, std::optional<std::size_t> top_level)
    : unknown_(std::move(levels)), top_level_(top_level) {
  if (top_level_) top_level_ = std::min(*top_level_, unknown_.levels().size() - 1);
}

std::span<const LevelProfile> PeerAccounts::levels() const {
  return top_level_ ? unknown_.levels().first(*top_level_ + 1) : unknown_.levels();
}

std::span<const LevelProfile> PeerAccounts::levels(PeerId peer, TimePoint now) {
  const std::size_t highest = times(peer).highest_within(share_.longest(peer, now));
  return levels().first(std::min(highest + 1, levels().size()));
}

std::size_t PeerAccounts::top_level(PeerId peer, Duration budget) const {
  return top_level_ ? *top_level_ : times(peer).highest_within(budget);
}

void PeerAccounts::know(PeerId peer) { accounts_.try_emplace(peer, Account{unknown_, {}}); }

void PeerAccounts::came(PeerId peer, TimePoint now) {
  know(peer);
  share_.came(peer, now);
}

void PeerAccounts::waits(PeerId peer, bool any) {
  if (any) {
    turns_.want(peer);
  } else {
    turns_.rest(peer);
  }
}

void PeerAccounts::begin(const Computed& job) {
  assert(!running_);
  running_ = job;
  turns_.begin(job.from);
}

Computed PeerAccounts::finish(TimePoint now) {
  assert(running_);
  Computed computed = *std::exchange(running_, std::nullopt);
  computed.ended = now;
  const Duration busy = computed.ended - computed.began;
  turns_.charge(computed.from, busy);
  total_.busy += busy;
  if (Account* account = find(computed.from)) account->work.busy += busy;
  return computed;
}

Computed PeerAccounts::end(TimePoint now, std::optional<Duration> took) {
  const Computed computed = finish(now);
  ++total_.computed;
  Account* account = find(computed.from);
  if (account == nullptr) return computed;
  ++account->work.computed;
  if (took) account->times.learn(computed.level, *took);
  return computed;
}

void PeerAccounts::fail(TimePoint now) {
  const Computed computed = finish(now);
  tell({computed.round, computed.from, NoAnswer::kUnreadable});
}

void PeerAccounts::tell(const Unanswered& job) {
  total_.count(job.why);
  Account* account = find(job.from);
  if (account == nullptr) return;
  account->work.count(job.why);
  unanswered_.push_back(job);
}

std::optional<Unanswered> PeerAccounts::poll_unanswered() {
  if (unanswered_.empty()) return std::nullopt;
  const Unanswered oldest = unanswered_.front();
  unanswered_.pop_front();
  return oldest;
}

void PeerAccounts::forget(PeerId peer) {
  accounts_.erase(peer);
  turns_.forget(peer);
  share_.forget(peer);
}

PeerWork PeerAccounts::work(PeerId peer) const {
  const auto found = accounts_.find(peer);
  return found == accounts_.end() ? PeerWork{} : found->second.work;
}

PeerAccounts::Account* PeerAccounts::find(PeerId peer) {
  const auto found = accounts_.find(peer);
  return found == accounts_.end() ? nullptr : &found->second;
}

const LevelTimes& PeerAccounts::times(PeerId peer) const {
  const auto found = accounts_.find(peer);
  return found == accounts_.end() ? unknown_ : found->second.times;
}

}  // namespace interneuron::computing
