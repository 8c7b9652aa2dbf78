// The live view of links that `interneuron top` shows: snapshots collected into series, drawn as
// lines of styled text, and the terminal that the lines are put on.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "app/watch/row.h"

namespace interneuron::watch {

// Collects snapshots of the links into series. Pure; thread-compatible; no errors. Memory:
// kMaxSamples values per link and peer, kMaxEvents events (history.cc).
class LinksHistory {
 public:
  // The values of one link towards one peer, the newest at the end. A negative one means that
  // nothing was measured at that time.
  struct Series {
    std::deque<double> rtt_ms;
    std::deque<double> rate_mbit;
    std::deque<double> loss_percent;
  };

  // To be called at even intervals, as series have no times.
  void add(LinksSnapshot snapshot);

  const LinksSnapshot& newest() const { return newest_; }
  const Series& series(const LinkRow& row) const;
  // The newest at the end.
  const std::deque<LinkEvent>& events() const { return events_; }

 private:
  LinksSnapshot newest_;
  std::map<std::string, Series> series_;
  std::deque<LinkEvent> events_;
};

enum class Style : std::uint8_t { kPlain, kDim, kBold, kTitle, kAccent, kGood, kWarn, kBad };

struct Span {
  // UTF-8 of which each character takes one column.
  std::string text;
  Style style = Style::kPlain;
};
using Line = std::vector<Span>;

struct Canvas {
  std::size_t width = 100;
  // 0: as many lines as are needed.
  std::size_t height = 0;
  // false: sparklines and bars consist of ASCII characters.
  bool unicode = true;
};

// Draws at most `height` lines of at most `width` columns. One line says how many links did not
// fit. Pure except that local times depend on the system's time zone; no errors.
std::vector<Line> draw(const LinksHistory& history, const Canvas& canvas);

// What the programs of a host keep of their peers: a line for each program that has peers, with the
// longest stall of its loop, and one for each peer that holds something or that a limit has struck:
// those that were struck most often first, at most kPeersShown of them. Nothing where there is no
// such program. Pure; no errors.
inline constexpr std::size_t kPeersShown = 8;
std::vector<Line> ledger_lines(const std::vector<LiveProgram>& programs);

// The lines without styles and without trailing blanks.
std::string plain_text(const std::vector<Line>& lines);

// A full-screen terminal, by ncurses: shows lines and reads keys, and knows nothing of what is
// shown. The destructor puts the terminal back as it was, also when an exception ends the view.
// ncurses keeps global state, so there may be one Terminal at a time, used by one thread.
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
