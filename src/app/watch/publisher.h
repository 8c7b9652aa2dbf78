// Makes a node's links visible to people: writes their changes to the log and publishes all values
// for `interneuron links` and `top` (live_state.h) twice a second while one of those is looking.
// Belongs to the node's loop thread.
#pragma once

#include <spdlog/spdlog.h>

#include <functional>
#include <string>
#include <utility>

#include "app/computing/jobs.h"
#include "app/watch/journal.h"
#include "app/watch/live_state.h"
#include "interneuron/node.h"

namespace interneuron::watch {

// How loud a path's change of state is in the log. A path that is suspect still carries data, and a
// loaded one may become suspect and ok again every second: that is for debugging. A path that takes
// no data any more is a warning, and its return is information.
spdlog::level::level_enum log_level(PathState from, PathState to);

// Belongs to the thread of the node's loop, on which the node calls it.
class LinkPublisher {
 public:
  // Sets the node's on_nic_changed, on_path_changed and on_statistics. Must live as long as the
  // node runs.
  LinkPublisher(Node& node, const std::string& program);

  // Publishes beside each peer's ledger what `work` says is computed for it. Must be callable as
  // long as the node runs.
  void add_work(std::function<computing::PeerWork(PeerId)> work) { work_ = std::move(work); }

  std::string name(LinkId link) { return journal_.name(link); }

 private:
  void publish(const Statistics& statistics);

  LinkJournal journal_;
  LiveServer server_;
  std::function<computing::PeerWork(PeerId)> work_;
};

}  // namespace interneuron::watch
