// Keeps the history of a node's links, as other programs are shown it (live_state.h): names,
// changes with their reasons, and the present measurements. Fed by the node's handlers, on the
// node's loop thread, to which it belongs.
#pragma once

#include <deque>
#include <map>
#include <string>
#include <utility>

#include "app/watch/row.h"
#include "interneuron/node.h"

namespace interneuron::watch {

class LinkJournal {
 public:
  // `program` is this program's name in LiveLinks. `node` must outlive this; add() is to be called
  // from its handlers.
  LinkJournal(const Node& node, std::string program) : node_(node), program_(std::move(program)) {}

  void add(const NicChanged& change);
  void add(const PathChanged& change);

  // The link's NIC; "link 3" for a link that is not known.
  std::string name(LinkId link);
  LiveLinks live(const Statistics& statistics) const;

 private:
  void add(LinkEvent event);

  const Node& node_;
  std::string program_;
  std::map<LinkId, std::string> names_;
  std::map<std::pair<PeerId, LinkId>, std::string> path_reasons_;
  // The newest kMaxEvents.
  std::deque<LinkEvent> events_;
};

}  // namespace interneuron::watch
