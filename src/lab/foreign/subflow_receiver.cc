#include <algorithm>

#include "lab/foreign/subflow.h"

namespace interneuron::foreign {
namespace {

// RFC 5681, section 4.2.
constexpr int kSegmentsPerAck = 2;

}  // namespace

void SubflowReceiver::segment(Duration now, const DataSegment& segment, bool marked) {
  if (segment.window_reduced) congestion_seen_ = false;
  if (marked) congestion_seen_ = true;
  const Range range{segment.sequence, segment.sequence + segment.piece.bytes};
  const bool in_order = range.from == next_ && gaps_beyond_.empty();
  // The stamp of the earliest segment that the acknowledgement covers; out of order that of the
  // segment itself.
  if (held_ == 0 || !in_order) echo_ = segment.sent;
  if (range.to > next_) add(range);
  advance();
  if (!in_order || ++held_ >= kSegmentsPerAck) {
    due_ = true;
  } else if (!timer_) {
    timer_ = now + kAckDelay;
  }
}

// Joins the range with those that it touches, and puts it first.
void SubflowReceiver::add(const Range& range) {
  Range whole = range;
  std::erase_if(gaps_beyond_, [&whole](const Range& other) {
    if (other.to < whole.from || other.from > whole.to) return false;
    whole = {std::min(whole.from, other.from), std::max(whole.to, other.to)};
    return true;
  });
  gaps_beyond_.insert(gaps_beyond_.begin(), whole);
}

void SubflowReceiver::advance() {
  const auto it =
      std::ranges::find_if(gaps_beyond_, [this](const Range& r) { return r.from <= next_; });
  if (it == gaps_beyond_.end()) return;
  next_ = std::max(next_, it->to);
  gaps_beyond_.erase(it);
}

void SubflowReceiver::handle_timeout(Duration now) {
  if (timer_ && now >= *timer_) due_ = true;
}

std::optional<AckSegment> SubflowReceiver::poll() {
  if (!due_) return std::nullopt;
  due_ = false;
  held_ = 0;
  timer_.reset();
  AckSegment ack{.acknowledged = next_,
                 .sack_count = std::min(kMostSackBlocks, gaps_beyond_.size())};
  std::copy_n(gaps_beyond_.begin(), ack.sack_count, ack.sacks.begin());
  ack.echo = echo_;
  ack.congestion_seen = congestion_seen_;
  return ack;
}

void StreamReceiver::read(const Piece& piece) {
  next_ += piece.bytes;
  if (piece.ends_message) whole_.push_back(piece.message);
}

void StreamReceiver::add(const Piece& piece) {
  // Pieces are never cut anew, so that one is either read already, next, or behind a gap.
  if (piece.offset > next_) waiting_.emplace(piece.offset, piece);
  if (piece.offset != next_) return;
  read(piece);
  while (!waiting_.empty() && waiting_.begin()->first <= next_) {
    const Piece behind = waiting_.begin()->second;
    waiting_.erase(waiting_.begin());
    if (behind.offset == next_) read(behind);
  }
}

std::optional<std::uint32_t> StreamReceiver::poll_message() {
  if (whole_.empty()) return std::nullopt;
  const std::uint32_t message = whole_.front();
  whole_.pop_front();
  return message;
}

}  // namespace interneuron::foreign
