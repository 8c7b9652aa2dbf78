#include "app/computing/peer_accounts.h"

#include <algorithm>
#include <cassert>
#include <utility>

namespace interneuron::computing {

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
