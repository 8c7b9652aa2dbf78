// Makes a node's links visible: changes go to the log, everything to `interneuron links` and `top`
// (live_state.h). For programs that run for long.
#pragma once

#include <string>

#include "app/watch/journal.h"
#include "app/watch/live_state.h"
#include "interneuron/node.h"

namespace interneuron::cli {

class LinkPublisher {
 public:
  // Sets the node's on_nic_changed, on_path_changed and on_statistics; must live as long as it
  // runs.
  LinkPublisher(Node& node, const std::string& program);

  std::string name(LinkId link) { return journal_.name(link); }

 private:
  LinkJournal journal_;
  LiveServer server_;
};

}  // namespace interneuron::cli
