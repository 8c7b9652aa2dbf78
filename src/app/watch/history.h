// Collects snapshots of the links into series, which `interneuron top` draws. Pure;
// thread-compatible; no errors. Memory: kMaxSamples values per link and peer, kMaxEvents events
// (history.cc).
#pragma once

#include <deque>
#include <map>
#include <string>

#include "app/watch/row.h"

namespace interneuron::watch {

class LinksHistory {
 public:
  // The values of one link towards one peer, the newest at the end. A negative one means that
  // nothing was measured at that time.
  struct Series {
    std::deque<double> rtt_ms;
    std::deque<double> rate_mbit;
    std::deque<double> loss_percent;
  };

  // To be called at even intervals, as series have no times.
  void add(LinksSnapshot snapshot);

  const LinksSnapshot& newest() const { return newest_; }
  const Series& series(const LinkRow& row) const;
  // The newest at the end.
  const std::deque<LinkEvent>& events() const { return events_; }

 private:
  LinksSnapshot newest_;
  std::map<std::string, Series> series_;
  std::deque<LinkEvent> events_;
};

}  // namespace interneuron::watch
