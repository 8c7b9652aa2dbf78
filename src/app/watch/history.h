// What was seen of the links so far: snapshots made into series. Pure.
#pragma once

#include <deque>
#include <map>
#include <string>

#include "app/watch/row.h"

namespace interneuron::cli {

class LinksHistory {
 public:
  // Of one link towards one peer, the newest at the end; negative: not measured then.
  struct Series {
    std::deque<double> rtt_ms;
    std::deque<double> rate_mbit;
    std::deque<double> loss_percent;
  };

  // In the order of time, at even intervals.
  void add(LinksSnapshot snapshot);

  const LinksSnapshot& newest() const { return newest_; }
  const Series& series(const LinkRow& row) const;
  const std::deque<LinkEvent>& events() const { return events_; }  // the newest at the end

 private:
  LinksSnapshot newest_;
  std::map<std::string, Series> series_;
  std::deque<LinkEvent> events_;
};

}  // namespace interneuron::cli
