// What a program that has a key does with what its node tells of trust: newer lists of revocations
// that peers hand on are kept for the next start (app/settings/fleet_files.h), and the log says
// when one came, when the list is too old, and when two hosts have the same key.
#pragma once

#include <cstdint>
#include <string>

#include "app/settings/key_options.h"
#include "interneuron/node.h"

namespace interneuron::watch {

// Belongs to the thread of the node's loop. Must be destroyed before the credentials, and not
// while the node runs.
class TrustKeeper {
 public:
  // Sets the node's handlers. `idle`: as for TimeKeeper.
  TrustKeeper(Node& node, const settings::Credentials& credentials, Queue idle);
  TrustKeeper(const TrustKeeper&) = delete;
  TrustKeeper& operator=(const TrustKeeper&) = delete;

 private:
  void take(RevocationsChanged event);
  void look();

  Node& node_;
  const settings::Credentials& credentials_;
  Queue idle_;
  // When the newest list was issued; 0: there is none.
  std::int64_t issued_s_ = 0;
  bool told_stale_ = false;
};

}  // namespace interneuron::watch
