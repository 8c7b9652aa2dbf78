#include "app/watch/screen.h"

#include <fmt/format.h>

#include <algorithm>

namespace interneuron::watch {
namespace {

// How many samples are kept: more than a sparkline has columns.
constexpr std::size_t kMaxSamples = 240;
// Some screens of them. No measurement is behind this value: it only has to be larger than what a
// window shows.
constexpr std::size_t kMaxEvents = 200;

std::string key_of(const LinkRow& row) {
  return row.facts.nic.name +
         (row.measured ? fmt::format("/{}/{}", row.measured->program, row.measured->peer) : "");
}

void keep(std::deque<double>& values, double value) {
  values.push_back(value);
  if (values.size() > kMaxSamples) values.pop_front();
}

}  // namespace

void LinksHistory::add(LinksSnapshot snapshot) {
  newest_ = std::move(snapshot);
  for (const LinkRow& row : newest_.rows) {
    if (!row.measured) continue;
    const LinkState& s = row.measured->state;
    const bool heard = s.age != Duration::max();
    Series& series = series_[key_of(row)];
    keep(series.rtt_ms, heard && s.rtt_p50 > Duration::zero() ? to_ms(s.rtt_p50) : -1);
    keep(series.rate_mbit, heard && s.rate.bits_per_second > 0 ? s.rate.mbit() : -1);
    keep(series.loss_percent, heard ? s.loss * 100 : -1);
  }
  for (const LinkEvent& event : newest_.events) {
    if (std::ranges::find(events_, event) == events_.end()) events_.push_back(event);
  }
  std::ranges::stable_sort(events_, {}, &LinkEvent::at);
  while (events_.size() > kMaxEvents) events_.pop_front();
}

const LinksHistory::Series& LinksHistory::series(const LinkRow& row) const {
  static const Series kNone;
  const auto found = series_.find(key_of(row));
  return found != series_.end() ? found->second : kNone;
}

}  // namespace interneuron::watch
