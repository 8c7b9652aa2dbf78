#include "core/peers/turns.h"

#include <algorithm>

namespace interneuron::peers {
namespace {

void erase(Ring<Turns::Slot>& ring, Turns::Slot peer) {
  for (std::size_t left = ring.size(); left > 0; --left) {
    const Turns::Slot front = ring.front();
    ring.pop_front();
    if (front != peer) ring.push_back(front);
  }
}

}  // namespace

void Turns::add(Slot peer) {
  if (peer >= waits_for_feedback_.size()) waits_for_feedback_.resize(std::size_t{peer} + 1);
  if (waits_for_feedback_[peer]) return;
  waits_for_feedback_[peer] = true;
  feedback_.push_back(peer);
}

std::optional<Turns::Slot> Turns::feedback() const {
  return feedback_.empty() ? std::nullopt : std::optional(feedback_.front());
}

void Turns::feedback_done() {
  waits_for_feedback_[feedback_.front()] = false;
  feedback_.pop_front();
}

Turns::Nic& Turns::nic(LinkId id) {
  const auto it = std::ranges::find(nics_, id, &Nic::id);
  if (it != nics_.end()) return *it;
  nics_.push_back({id, {}, {}});
  return nics_.back();
}

void Turns::add(Slot peer, LinkId id) {
  Nic& n = nic(id);
  if (peer >= n.accounts.size()) n.accounts.resize(std::size_t{peer} + 1);
  Account& account = n.accounts[peer];
  if (account.waits) return;
  account = {kQuantum, true};
  n.waiting.push_back(peer);
}

std::optional<Turns::Turn> Turns::data() {
  for (std::size_t tried = 0; tried < nics_.size(); ++tried, advance()) {
    Nic& n = nics_[turn_];
    if (n.waiting.empty()) continue;
    // A packet is no larger than the quantum, so a second round finds somebody with credit.
    for (;;) {
      const Slot peer = n.waiting.front();
      Account& account = n.accounts[peer];
      if (account.credit > 0) return Turn{peer, n.id};
      account.credit += kQuantum;
      n.waiting.pop_front();
      n.waiting.push_back(peer);
    }
  }
  return std::nullopt;
}

void Turns::advance() { turn_ = turn_ + 1 < nics_.size() ? turn_ + 1 : 0; }

void Turns::sent(std::size_t ip_bytes) {
  Nic& n = nics_[turn_];
  n.accounts[n.waiting.front()].credit -= static_cast<std::int64_t>(ip_bytes);
  advance();
}

void Turns::done() {
  Nic& n = nics_[turn_];
  n.accounts[n.waiting.front()].waits = false;
  n.waiting.pop_front();
}

void Turns::forget(Slot peer) {
  if (peer < waits_for_feedback_.size() && waits_for_feedback_[peer]) {
    waits_for_feedback_[peer] = false;
    erase(feedback_, peer);
  }
  for (Nic& n : nics_) {
    if (peer >= n.accounts.size() || !n.accounts[peer].waits) continue;
    n.accounts[peer].waits = false;
    erase(n.waiting, peer);
  }
}

}  // namespace interneuron::peers
