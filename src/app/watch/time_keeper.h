// Stores the time of a program that has a key beside that key (app/settings/key_files.h): at the
// start, while it runs and at the end. What is stored is a little ahead of what peers are told
// until it is written again, so that even a life that ends without warning leaves none that was
// used.
#pragma once

#include "app/settings/key_options.h"
#include "interneuron/node.h"

namespace interneuron::watch {

// Belongs to the thread of the node's loop. Must be destroyed before the node and the credentials.
class TimeKeeper {
 public:
  // `idle`: the queue of the node in which nothing waits that has a deadline; files are written
  // there. A file that cannot be written is a warning in the log, once.
  TimeKeeper(Node& node, const settings::Credentials& credentials, Queue idle);
  ~TimeKeeper();
  TimeKeeper(const TimeKeeper&) = delete;
  TimeKeeper& operator=(const TimeKeeper&) = delete;

 private:
  void look();
  void warn(const std::string& problem);

  Node& node_;
  // nullptr: there is no key, and nothing to do.
  const settings::TimeFile* file_;
  Queue idle_;
  // The newest time that was, or is being, stored.
  std::int64_t stored_ = 0;
  bool warned_ = false;
};

}  // namespace interneuron::watch
