// The sessions that belong to nobody yet: of hosts that have proved who they are, and not where.
#include <algorithm>

#include "core/secure/sessions.h"

namespace interneuron::crypto {

void Sessions::add_unowned(TimePoint now, std::uint32_t index) {
  Unowned& of_key = unowned_[live_.at(index).who];
  drop_unowned(of_key.former);
  of_key.former = of_key.newest;
  of_key.newest = index;
  unowned_order_.push_back(index);
  if (unowned_order_.size() > kMaxUnowned) forget_unowned(unowned_order_.front());
  expire_unowned(now);
}

void Sessions::expire_unowned(TimePoint now) {
  while (!unowned_order_.empty() && live_.at(unowned_order_.front()).session.is_over(now)) {
    forget_unowned(unowned_order_.front());
  }
}

void Sessions::forget_unowned(std::uint32_t index) {
  const auto of_key = unowned_.find(live_.at(index).who);
  Unowned& both = of_key->second;
  (both.newest == index ? both.newest : both.former) = 0;
  if (both.newest == 0 && both.former == 0) unowned_.erase(of_key);
  drop_unowned(index);
}

void Sessions::drop_unowned(std::uint32_t& index) {
  if (index == 0) return;
  std::erase(unowned_order_, index);
  drop(index);
}

}  // namespace interneuron::crypto
