// Long work on all processors, which says on stderr how far it is. Ctrl-C ends it.
#pragma once

#include <cstddef>
#include <functional>
#include <string>

#include "app/process/status_line.h"

namespace interneuron::process {

// Runs a list of independent jobs on all processors and shows on stderr how many are done: on a
// terminal as a line that is written again and again. A SignalWatch must be alive, by which Ctrl-C
// ends the work between two jobs. for_each() takes the calling thread; its jobs run on other
// threads that end with it. Nothing is shown when `quiet`.
class Progress {
 public:
  explicit Progress(bool quiet = false) : quiet_(quiet) {}

  // Calls work(0 … count-1), several at a time and in any order: they must not share anything.
  // Throws what a call threw, or Failure (128 + signal).
  void for_each(const std::string& what, std::size_t count,
                const std::function<void(std::size_t)>& work);

 private:
  void tell(const std::string& what, std::size_t done, std::size_t count);

  bool quiet_;
  StatusLine line_;
};

}  // namespace interneuron::process
