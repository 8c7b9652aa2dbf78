// WindowFlow: how soon small messages follow each other, and which of them symbols are to cover.
#include "core/base/earliest.h"
#include "core/flow/windows.h"

namespace interneuron::flow {
namespace {

// A pause that is longer begins a flow anew. No measurement behind this value: it only has to be
// longer than any deadline that a window may help with.
constexpr Duration kPause = std::chrono::seconds(1);
// By how many mean deviations the next message may be later than the mean gap: Gaussian gaps are
// in 95 % of all cases.
constexpr int kDeviations = 2;

}  // namespace

void WindowFlow::note_left(TimePoint now) {
  if (newest_ && now - *newest_ <= kPause) {
    // As round trips are in RFC 6298.
    const Duration gap = now - *newest_;
    if (!gap_) {
      gap_ = gap;
      deviation_ = gap / 2;
    } else {
      const Duration off = gap > *gap_ ? gap - *gap_ : *gap_ - gap;
      deviation_ += (off - deviation_) / 4;
      *gap_ += (gap - *gap_) / 8;
    }
  } else {
    gap_.reset();
  }
  newest_ = now;
}

std::optional<TimePoint> WindowFlow::next() const {
  if (!newest_ || !gap_) return std::nullopt;
  return *newest_ + *gap_ + kDeviations * deviation_;
}

void WindowFlow::add(MessageId message, std::size_t pieces, TimePoint latest) {
  pending_.push_back(message);
  pieces_ += pieces;
  due_ = earliest(due_, std::optional(latest));
}

void WindowFlow::clear_pending() {
  pending_ = {};
  pieces_ = 0;
  due_.reset();
}

WindowFlow::Symbol& WindowFlow::push() {
  if (symbols_.size() < kMostSymbols) symbols_.resize(kMostSymbols);
  Symbol& symbol = symbols_[next_symbol_];
  next_symbol_ = (next_symbol_ + 1) % kMostSymbols;
  symbol.waits = true;
  return symbol;
}

std::uint8_t WindowFlow::next_row() {
  const std::uint8_t row = row_;
  row_ = static_cast<std::uint8_t>((row_ + 1U) % code::kMostRows);
  return row;
}

}  // namespace interneuron::flow
