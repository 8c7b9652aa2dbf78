// What a sender keeps of its small messages for windows: how soon one follows the other, which of
// them the next symbols are to cover, and symbols that wait to leave.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/base/earliest.h"
#include "core/wire/window.h"
#include "interneuron/few.h"
#include "interneuron/link.h"
#include "interneuron/sizes.h"
#include "interneuron/units.h"

namespace interneuron::flow {

// Sender owns one, and fills and empties it (plan_windows.cc). All small coded messages to a peer
// are one flow, whatever their channels: the more there are, the less each pays for a symbol.
//
// Plain values. Memory: symbols that wait keep theirs for the next ones, at most kMostSymbols of
// one packet each. Pure; thread-compatible; never throws but std::bad_alloc.
class WindowFlow {
 public:
  static constexpr std::size_t kMostSymbols = 8;

  // Whether the peer decodes windows.
  bool is_understood() const { return understood_; }
  void set_understood(bool understood) { understood_ = understood; }

  // --- how soon one follows the other
  // All of a small message has left.
  void note_left(TimePoint now) {
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
  // When the next one will have left; nothing: not known.
  std::optional<TimePoint> next() const {
    if (!newest_ || !gap_) return std::nullopt;
    return *newest_ + *gap_ + kDeviations * deviation_;
  }

  // --- which ones are to be covered
  using Pending = Few<MessageId, wire::kMostWindowMessages>;
  const Pending& pending() const { return pending_; }
  // A symbol is to cover this one too, which has so many pieces; it has to leave at `latest`.
  void add(MessageId message, std::size_t pieces, TimePoint latest) {
    pending_.push_back(message);
    pieces_ += pieces;
    due_ = earliest(due_, std::optional(latest));
  }
  // Whether one of so many pieces can be covered as well.
  bool has_room(std::size_t pieces) const {
    return pending_.size() < wire::kMostWindowMessages && pieces_ + pieces <= code::kMostSources;
  }
  void clear_pending() {
    pending_ = {};
    pieces_ = 0;
    due_.reset();
  }
  // When a symbol has to leave for what is pending.
  std::optional<TimePoint> due() const { return due_; }

  // --- symbols that wait to leave
  struct Symbol {
    LinkId path{};
    // Nobody wants it to leave later.
    TimePoint until{};
    wire::WindowHeader header;
    Bytes bytes;
    bool waits = false;
    std::size_t ip_bytes() const {
      return wire::window_header_bytes(header.messages.size()) + bytes.size() + kOverhead;
    }
  };
  // One to be filled in; the oldest makes room for it.
  Symbol& push() {
    if (symbols_.size() < kMostSymbols) symbols_.resize(kMostSymbols);
    Symbol& symbol = symbols_[next_symbol_];
    next_symbol_ = (next_symbol_ + 1) % kMostSymbols;
    symbol.waits = true;
    return symbol;
  }
  // The oldest that waits for this path, if there is one; nullptr.
  Symbol* front(LinkId path) {
    for (std::size_t i = 0; i < symbols_.size(); ++i) {
      Symbol& symbol = symbols_[(next_symbol_ + i) % kMostSymbols];
      if (symbol.waits && symbol.path == path) return &symbol;
    }
    return nullptr;
  }
  bool waits(LinkId path) const { return const_cast<WindowFlow*>(this)->front(path) != nullptr; }
  void remove_path(LinkId path) {
    while (Symbol* symbol = front(path)) symbol->waits = false;
  }
  // Successive symbols are different rows.
  std::uint8_t next_row() {
    const std::uint8_t row = row_;
    row_ = static_cast<std::uint8_t>((row_ + 1U) % code::kMostRows);
    return row;
  }
  // The peer began a new life.
  void reset() { *this = {}; }

 private:
  // A pause that is longer begins a flow anew. No measurement behind this value: it only has to be
  // longer than any deadline that a window may help with.
  static constexpr Duration kPause = std::chrono::seconds(1);
  // By how many mean deviations the next message may be later than the mean gap: Gaussian gaps are
  // in 95 % of all cases.
  static constexpr int kDeviations = 2;
  // Header and tag of a packet, and those of IP and UDP.
  static constexpr std::size_t kOverhead = 36 + kIpUdpBytes;

  bool understood_ = false;
  std::optional<TimePoint> newest_;
  std::optional<Duration> gap_;
  Duration deviation_{};
  Pending pending_;
  std::size_t pieces_ = 0;
  std::optional<TimePoint> due_;
  std::vector<Symbol> symbols_;
  std::size_t next_symbol_ = 0;
  std::uint8_t row_ = 0;
};

}  // namespace interneuron::flow
