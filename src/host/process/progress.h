// Long work on all processors, which says on stderr how far it is. Ctrl-C ends it.
#pragma once

#include <cstddef>
#include <functional>
#include <string>

namespace interneuron::cli::eval {

// Needs a SignalWatch to be alive.
class Progress {
 public:
  explicit Progress(bool quiet = false) : quiet_(quiet) {}

  // Calls work(0 … count-1), several at a time and in any order: they must not share anything.
  // Throws what a call threw, or Failure (128 + signal).
  void for_each(const std::string& what, std::size_t count,
                const std::function<void(std::size_t)>& work);

 private:
  void tell(const std::string& what, std::size_t done, std::size_t count) const;

  bool quiet_;
};

}  // namespace interneuron::cli::eval
