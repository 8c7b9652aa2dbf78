#include "app/watch/screen.h"

#include <langinfo.h>

#include <clocale>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "app/process/failure.h"

// Last, for its macros.
#define NCURSES_NOMACROS 1
#include <curses.h>

namespace interneuron::watch {

namespace {

enum Pair : short { kAccentPair = 1, kGoodPair, kWarnPair, kBadPair };

attr_t attributes(Style style, bool color) {
  const auto color_of = [color](Pair pair) {
    return color ? static_cast<attr_t>(COLOR_PAIR(pair)) : A_NORMAL;
  };
  switch (style) {
    case Style::kPlain:
      return A_NORMAL;
    case Style::kDim:
      return A_DIM;
    case Style::kBold:
      return A_BOLD;
    case Style::kTitle:
      return A_REVERSE;
    case Style::kAccent:
      return color_of(kAccentPair);
    case Style::kGood:
      return color_of(kGoodPair);
    case Style::kWarn:
      return color_of(kWarnPair) | A_BOLD;
    case Style::kBad:
      return color_of(kBadPair) | A_BOLD;
  }
  return A_NORMAL;
}

}  // namespace

struct Terminal::Screen {
  SCREEN* screen = nullptr;
};

Terminal::Terminal(bool color) : screen_(std::make_unique<Screen>()), color_(color) {
  std::setlocale(LC_CTYPE, "");
  unicode_ = std::strcmp(::nl_langinfo(CODESET), "UTF-8") == 0;
  // Not initscr(): that ends the program when it does not know the terminal.
  screen_->screen = ::newterm(nullptr, stdout, stdin);
  if (screen_->screen == nullptr) {
    const char* term = std::getenv("TERM");
    throw process::Failure(
        process::kUsage, "the terminal '" + std::string(term == nullptr ? "" : term) +
                             "' is not known; set TERM, or use `interneuron links --json-stream`");
  }
  ::set_term(screen_->screen);
  ::cbreak();
  ::noecho();
  ::nonl();
  ::keypad(stdscr, TRUE);
  ::curs_set(0);
  color_ = color_ && ::has_colors();
  if (!color_) return;
  ::start_color();
  ::use_default_colors();
  ::init_pair(kAccentPair, COLOR_CYAN, -1);
  ::init_pair(kGoodPair, COLOR_GREEN, -1);
  ::init_pair(kWarnPair, COLOR_YELLOW, -1);
  ::init_pair(kBadPair, COLOR_RED, -1);
}

Terminal::~Terminal() {
  ::endwin();
  ::delscreen(screen_->screen);
}

std::size_t Terminal::width() const { return static_cast<std::size_t>(::getmaxx(stdscr)); }
std::size_t Terminal::height() const { return static_cast<std::size_t>(::getmaxy(stdscr)); }

void Terminal::show(const std::vector<Line>& lines) {
  ::werase(stdscr);
  int row = 0;
  for (const Line& line : lines) {
    ::wmove(stdscr, row++, 0);
    for (const Span& span : line) {
      ::wattrset(stdscr, static_cast<int>(attributes(span.style, color_)));
      ::waddnstr(stdscr, span.text.c_str(), -1);
    }
  }
  ::wattrset(stdscr, A_NORMAL);
  ::wrefresh(stdscr);
}

int Terminal::key(int wait_ms) {
  ::wtimeout(stdscr, wait_ms);
  const int key = ::wgetch(stdscr);
  return key == ERR || key == KEY_RESIZE ? 0 : key;
}

}  // namespace interneuron::watch
