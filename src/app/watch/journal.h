// What a node's links went through: their names, their changes with the reasons, and what is
// measured of them now. Belongs to the node's loop thread.
#pragma once

#include <deque>
#include <map>
#include <string>
#include <utility>

#include "app/watch/row.h"
#include "interneuron/node.h"

namespace interneuron::cli {

class LinkJournal {
 public:
  // `program`: its name in LiveLinks. Reads `node`, which must live longer; add() is to be called
  // from the node's handlers.
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
  std::deque<LinkEvent> events_;  // the newest kMaxEvents
};

}  // namespace interneuron::cli
