#include "core/secure/session.h"

#include <algorithm>

namespace interneuron::crypto {

bool ReplayWindow::is_new(std::uint64_t number) const {
  if (is_empty_ || number > largest_) return true;
  if (largest_ - number > kReach) return false;
  const std::uint64_t word = words_[number / kWordBits % kWords];
  return (word >> number % kWordBits & 1U) == 0;
}

void ReplayWindow::take(std::uint64_t number) {
  const std::uint64_t index = number / kWordBits;
  if (is_empty_ || number > largest_) {
    const std::uint64_t from = is_empty_ ? index : largest_ / kWordBits;
    const std::uint64_t cleared = std::min<std::uint64_t>(index - from, kWords);
    for (std::uint64_t i = 0; i < cleared; ++i) words_[(index - i) % kWords] = 0;
    largest_ = number;
    is_empty_ = false;
  }
  words_[index % kWords] |= std::uint64_t{1} << number % kWordBits;
}

}  // namespace interneuron::crypto
