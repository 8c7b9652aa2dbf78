#include "core/rounds/kept_rounds.h"

#include <algorithm>

namespace interneuron::rounds {

bool Previewed::fits(std::size_t count, std::span<const LinkState> links) const {
  return count == variants && std::ranges::all_of(plan.sends, [links](const Assignment& a) {
           return std::ranges::any_of(
               links, [&a](const LinkState& link) { return link.up && link.id == a.link; });
         });
}

RoundContext* Contexts::find(const RoundRef& round) {
  const auto it = contexts_.find(round);
  return it == contexts_.end() ? nullptr : &it->second.context;
}

std::optional<PeerId> Contexts::owner(const RoundRef& round) const {
  const auto it = contexts_.find(round);
  return it == contexts_.end() ? std::nullopt : std::optional(it->second.owner);
}

bool Contexts::open(TimePoint now, PeerId owner, const RoundRef& round, RoundContext context,
                    TimePoint expires, std::size_t most) {
  while (!expiries_.empty() && expiries_.begin()->first < now) close(expiries_.begin()->second);
  close(round);
  const bool has_room = count(owner) < most;
  if (!has_room) close(owned_.at(owner).begin()->second);
  contexts_.emplace(round, Opened{std::move(context), owner, ++opened_, expires});
  expiries_.emplace(expires, round);
  owned_[owner].emplace(opened_, round);
  return has_room;
}

void Contexts::close(RoundRef round) {
  const auto it = contexts_.find(round);
  if (it == contexts_.end()) return;
  expiries_.erase({it->second.expires, round});
  const auto owned = owned_.find(it->second.owner);
  owned->second.erase(it->second.number);
  if (owned->second.empty()) owned_.erase(owned);
  contexts_.erase(it);
}

void Contexts::forget(PeerId owner) {
  while (count(owner) > 0) close(owned_.at(owner).begin()->second);
}

std::size_t Contexts::count(PeerId owner) const {
  const auto it = owned_.find(owner);
  return it == owned_.end() ? 0 : it->second.size();
}

}  // namespace interneuron::rounds
