#include "app/computing/fair_turns.h"

#include <algorithm>

namespace interneuron::computing {

void FairTurns::want(PeerId peer) {
  Account& account = accounts_[peer];
  if (account.since != 0) return;
  account.since = ++calls_;
  account.served = std::max(account.served, reached_);
  order_.insert(place(peer, account));
}

void FairTurns::rest(PeerId peer) {
  const auto found = accounts_.find(peer);
  if (found == accounts_.end() || found->second.since == 0) return;
  order_.erase(place(peer, found->second));
  found->second.since = 0;
}

void FairTurns::forget(PeerId peer) {
  rest(peer);
  accounts_.erase(peer);
}

std::optional<PeerId> FairTurns::next() const {
  if (order_.empty()) return std::nullopt;
  return std::get<PeerId>(*order_.begin());
}

void FairTurns::begin(PeerId peer) {
  const auto found = accounts_.find(peer);
  if (found != accounts_.end()) reached_ = std::max(reached_, found->second.served);
}

void FairTurns::charge(PeerId peer, Duration took) {
  const auto found = accounts_.find(peer);
  if (found == accounts_.end()) return;
  Account& account = found->second;
  const bool wants = account.since != 0;
  if (wants) order_.erase(place(peer, account));
  account.served += std::max(took, Duration{});
  if (wants) order_.insert(place(peer, account));
}

}  // namespace interneuron::computing
