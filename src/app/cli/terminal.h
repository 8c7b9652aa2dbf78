// A full-screen terminal: ncurses, and nothing that knows what is shown. It is as it was before
// when this object is gone, however that comes about.
#pragma once

#include <memory>
#include <vector>

#include "app/watch/screen.h"

namespace interneuron::cli {

// One at a time.
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
  // Waits for a key for so long; 0: none came, a signal did, or the window has another size.
  int key(int wait_ms);

 private:
  struct Screen;
  std::unique_ptr<Screen> screen_;
  bool color_;
  bool unicode_ = true;
};

}  // namespace interneuron::cli
