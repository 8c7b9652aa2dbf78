// A full-screen terminal, by ncurses: shows lines of styled text and reads keys, and knows nothing
// of what is shown. The destructor puts the terminal back as it was, also when an exception ends
// the view. ncurses keeps global state, so there may be one Terminal at a time, used by one thread.
#pragma once

#include <memory>
#include <vector>

#include "app/watch/screen.h"

namespace interneuron::watch {

class Terminal {
 public:
  // Throws Failure (2) when the terminal cannot be drawn on (TERM unknown).
  explicit Terminal(bool color);
  ~Terminal();
  Terminal(const Terminal&) = delete;
  Terminal& operator=(const Terminal&) = delete;

  std::size_t width() const;
  std::size_t height() const;
  bool unicode() const { return unicode_; }
  void show(const std::vector<Line>& lines);
  // Waits up to `wait_ms` milliseconds for a key. 0 when none came, when a signal did, or when the
  // window has another size now.
  int key(int wait_ms);

 private:
  struct Screen;
  std::unique_ptr<Screen> screen_;
  bool color_;
  bool unicode_ = true;
};

}  // namespace interneuron::watch
