#include "app/watch/journal.h"

#include <unistd.h>

namespace interneuron::watch {

namespace {

// A screen of them. No measurement is behind this value: `top` keeps events itself, so it only has
// to be larger than the events of the half second between two lines.
constexpr std::size_t kMaxJournalEvents = 50;

}  // namespace

void LinkJournal::add(const NicChanged& change) {
  names_[change.link] = change.nic;
  add(LinkEvent{.at = node_.now(),
                .nic = change.nic,
                .from = std::string(to_string(change.from)),
                .to = std::string(to_string(change.to)),
                .reason = change.reason});
}

void LinkJournal::add(const PathChanged& change) {
  path_reasons_[{change.peer, change.link}] = change.reason;
  add(LinkEvent{.at = node_.now(),
                .nic = name(change.link),
                .from = std::string(to_string(change.from)),
                .to = std::string(to_string(change.to)),
                .reason = change.reason});
}

void LinkJournal::add(LinkEvent event) {
  events_.push_back(std::move(event));
  if (events_.size() > kMaxJournalEvents) events_.pop_front();
}

std::string LinkJournal::name(LinkId link) {
  if (!names_.contains(link)) {
    for (const Statistics::Link& l : node_.statistics().links) names_[l.id] = l.nic;
  }
  const auto found = names_.find(link);
  return found != names_.end() ? found->second : "link " + std::to_string(link.value);
}

LiveLinks LinkJournal::live(const Statistics& statistics) const {
  LiveLinks live{.program = program_,
                 .pid = ::getpid(),
                 .links = {},
                 .events = {},
                 .loop_stall = statistics.loop_stall};
  for (const Statistics::Peer& peer : statistics.peers) {
    live.peers.push_back({peer.id.value, peer.ledger});
  }
  for (const Statistics::Link& link : statistics.links) {
    for (const Statistics::Peer& peer : statistics.peers) {
      for (const LinkState& state : peer.links) {
        if (state.id != link.id) continue;
        const auto reason = path_reasons_.find({peer.id, link.id});
        live.links.push_back(
            {link.nic, Measured{.program = program_,
                                .peer = peer.id.value,
                                .state = state,
                                .path_reason = reason != path_reasons_.end() ? reason->second : "",
                                .counters = link.counters}});
      }
    }
  }
  live.events.assign(events_.begin(), events_.end());
  return live;
}

}  // namespace interneuron::watch
