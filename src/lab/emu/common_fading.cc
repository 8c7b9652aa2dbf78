#include "lab/emu/common_fading.h"

#include <algorithm>
#include <cassert>

namespace interneuron::emu {

void couple(std::span<const std::shared_ptr<DelayProcess>> processes, double c,
            std::uint64_t seed) {
  if (c <= 0 || processes.size() < 2) return;
  auto fading = std::make_shared<CommonFading>(c, seed);
  for (const auto& process : processes) CommonFading::join(fading, *process);
}

void CommonFading::join(const std::shared_ptr<CommonFading>& group, DelayProcess& process) {
  assert(process.made() == 1 && !process.fading_);
  process.fading_ = group;
  group->members_.push_back(&process);
}

void CommonFading::remove(const DelayProcess& process) {
  std::replace(members_.begin(), members_.end(), const_cast<DelayProcess*>(&process),
               static_cast<DelayProcess*>(nullptr));
}

void CommonFading::make_step() {
  entered_.assign(members_.size(), false);
  for (std::size_t i = 0; i < members_.size(); ++i) {
    entered_[i] = members_[i] != nullptr && members_[i]->end_episode();
  }
  for (std::size_t i = 0; i < members_.size(); ++i) {
    if (!entered_[i]) continue;
    for (DelayProcess* other : members_) {
      // Drawn for every other, whatever its state, so that one link's state does not shift the
      // draws of the rest.
      const bool triggered = stream_.chance(c_);
      if (other == nullptr || !triggered || other->params_.trace) continue;
      if (other->state_ == RadioState::kStable) other->enter(RadioState::kEdge);
    }
  }
  for (DelayProcess* member : members_) {
    if (member != nullptr) member->append_sample();
  }
}

}  // namespace interneuron::emu
