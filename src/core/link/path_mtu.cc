#include "core/link/path_mtu.h"

#include <algorithm>

namespace interneuron::link {

// --- probes

std::size_t PathMtu::probe_size() const {
  return tried_ > most_ ? most_ : (datagram_ + tried_) / 2;
}

bool PathMtu::probe_due() const { return !is_done() && !number_ && (ready_ || !sent_at_); }

void PathMtu::probe_sent(TimePoint now, std::uint64_t number) {
  number_ = number;
  size_ = probe_size();
  sent_at_ = now;
  blind_ = !ready_;
  passed_ = false;
}

void PathMtu::probe_told(bool arrived) {
  if (!number_) return;
  if (!arrived) {
    passed_ = true;
    return;
  }
  number_.reset();
  lost_ = 0;
  datagram_ = std::max(datagram_, size_);
}

void PathMtu::handle_timeout(TimePoint now) {
  const auto due = next_timeout();
  if (!due || now < *due) return;
  if (!number_) return search();
  number_.reset();
  if (!passed_ || blind_ || ++lost_ < kMaxProbes) return;
  lost_ = 0;
  tried_ = size_;
}

std::optional<TimePoint> PathMtu::next_timeout() const {
  if (number_) return *sent_at_ + kProbeTimer;
  if (is_done() && tried_ <= most_) return *sent_at_ + kRaise;
  return std::nullopt;
}

void PathMtu::search() {
  tried_ = most_ + 1;
  lost_ = 0;
  number_.reset();
}

// --- what became of packets

void PathMtu::Told::arrived(TimePoint sent_at, bool large) {
  std::optional<TimePoint>& newest = large ? large_arrived : small_arrived;
  newest = std::max(newest.value_or(sent_at), sent_at);
}

void PathMtu::Told::lost(TimePoint sent_at) {
  if (large_lost++ == 0) first_lost = last_lost = sent_at;
  first_lost = std::min(first_lost, sent_at);
  last_lost = std::max(last_lost, sent_at);
}

void PathMtu::packets_told(const Told& told) {
  if (told.large_lost > 0) {
    if (run_.large_lost == 0) run_.first_lost = told.first_lost;
    run_.first_lost = std::min(run_.first_lost, told.first_lost);
    run_.last_lost = std::max(run_.last_lost, told.last_lost);
    run_.large_lost += told.large_lost;
  }
  if (run_.large_lost == 0) return;
  if (told.large_arrived && *told.large_arrived >= run_.first_lost) {
    run_ = {};
    return;
  }
  if (!run_.small_arrived && told.small_arrived && *told.small_arrived > run_.first_lost) {
    run_.small_arrived = told.small_arrived;
  }
  const bool is_hole = run_.large_lost >= kBlackHolePackets &&
                       run_.last_lost - run_.first_lost >= kBlackHoleTime && run_.small_arrived &&
                       *run_.small_arrived < run_.last_lost;
  if (!is_hole) return;
  run_ = {};
  datagram_ = kBase;
  search();
}

}  // namespace interneuron::link
