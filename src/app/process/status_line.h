// What stderr shows of work that takes a while.
#pragma once

#include <cstddef>
#include <string_view>

namespace interneuron::process {

// Text on a terminal's stderr that is written over with each newer one: progress and countdowns.
// Where stderr is no terminal (a log, a pipe) nothing is shown: live() tells, so that the caller
// may say something that stays instead. The last text stays on the screen until clear() or keep();
// whoever prints elsewhere in between calls one of them first. For one thread.
class StatusLine {
 public:
  StatusLine();

  // Stderr is a terminal.
  bool live() const { return live_; }
  // Replaces the text shown; several lines are parted by '\n', the last one has none at its end.
  void show(std::string_view text);
  // Takes the text away: the next output stands where it stood.
  void clear();
  // Leaves the text: the next output stands below it.
  void keep();

 private:
  bool live_;
  bool shown_ = false;
  // How far the cursor stands below the first line of the text.
  std::size_t lines_down_ = 0;
};

}  // namespace interneuron::process
