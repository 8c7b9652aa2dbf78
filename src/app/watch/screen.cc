#include "app/watch/screen.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <ctime>
#include <functional>

#include "app/watch/table.h"

namespace interneuron::watch {
namespace {

// Lines that the log of events keeps when links fill the screen.
constexpr std::size_t kMinLog = 5;
constexpr std::size_t kIndent = 2;
// Lines are laid out for this many columns at least and cut off at the edge of a narrower window:
// with fewer, a name and a number do not fit side by side.
constexpr std::size_t kMinWidth = 40;

Style style_of(NicState state) {
  return state == NicState::kReady                                      ? Style::kGood
         : state == NicState::kNoRoute || state == NicState::kNoAddress ? Style::kWarn
                                                                        : Style::kDim;
}

Style style_of(PathState path) {
  return path == PathState::kOk        ? Style::kGood
         : path == PathState::kSuspect ? Style::kWarn
                                       : Style::kBad;
}

// --- the table

struct Column {
  const char* title;
  std::size_t width;
  bool right;
  // How dispensable the column is: those with the largest number are left out first.
  int need;
  std::function<Span(const LinkRow&)> cell;
};

using M = const LinkState&;

Span measured(const LinkRow& row, const std::function<std::string(M)>& text) {
  const bool heard = row.measured && row.measured->state.age != Duration::max();
  const std::string cell = heard ? text(row.measured->state) : kNothing;
  return {cell, cell == kNothing ? Style::kDim : Style::kPlain};
}

const std::vector<Column>& all_columns() {
  static const std::vector<Column> columns = {
      {"NIC", 11, false, 0,
       [](const LinkRow& r) {
         return Span{r.facts.nic.name, Style::kBold};
       }},
      {"KIND", 8, false, 6,
       [](const LinkRow& r) {
         return Span{r.facts.nic.kind, Style::kDim};
       }},
      {"STATE", 10, false, 0,
       [](const LinkRow& r) {
         return Span{std::string(to_string(r.facts.state)), style_of(r.facts.state)};
       }},
      {"PATH", 7, false, 0,
       [](const LinkRow& r) {
         if (!r.measured) return Span{kNothing, Style::kDim};
         const PathState path = r.measured->state.path;
         return Span{std::string(to_string(path)), style_of(path)};
       }},
      {"ADDRESS", 18, false, 5,
       [](const LinkRow& r) {
         return Span{address_text(r.facts.nic.addresses), Style::kDim};
       }},
      {"RTT p50", 7, true, 0,
       [](const LinkRow& r) { return measured(r, [](M s) { return ms_text(s.rtt_p50); }); }},
      {"p95 ms", 6, true, 2,
       [](const LinkRow& r) { return measured(r, [](M s) { return ms_text(s.rtt_p95); }); }},
      {"JITTER", 6, true, 4,
       [](const LinkRow& r) { return measured(r, [](M s) { return ms_text(s.jitter); }); }},
      {"LOSS %", 6, true, 0,
       [](const LinkRow& r) {
         Span span = measured(r, [](M s) { return percent_text(s.loss); });
         if (r.measured && span.text != kNothing && r.measured->state.loss >= 0.01) {
           span.style = r.measured->state.loss >= 0.05 ? Style::kBad : Style::kWarn;
         }
         return span;
       }},
      {"UP", 6, true, 0,
       [](const LinkRow& r) { return measured(r, [](M s) { return mbit_text(s.rate); }); }},
      {"DOWN Mbit/s", 11, true, 3,
       [](const LinkRow& r) { return measured(r, [](M s) { return mbit_text(s.rate_down); }); }},
      {"AGE", 5, true, 1,
       [](const LinkRow& r) { return measured(r, [](M s) { return age_text(s.age); }); }},
  };
  return columns;
}

std::vector<const Column*> columns_that_fit(std::size_t width) {
  std::vector<const Column*> chosen;
  for (const Column& column : all_columns()) chosen.push_back(&column);
  const auto total = [&chosen] {
    std::size_t sum = kIndent;
    for (const Column* c : chosen) sum += c->width + 1;
    return sum;
  };
  while (total() > width) {
    const auto least = std::ranges::max_element(chosen, {}, &Column::need);
    if ((*least)->need == 0) break;
    chosen.erase(least);
  }
  return chosen;
}

// Links with figures first, else in the kernel's order.
std::vector<const LinkRow*> in_order(const LinksSnapshot& snapshot) {
  std::vector<const LinkRow*> rows;
  for (const LinkRow& row : snapshot.rows) {
    if (is_of_interest(row)) rows.push_back(&row);
  }
  std::stable_partition(rows.begin(), rows.end(),
                        [](const LinkRow* r) { return r->measured.has_value(); });
  return rows;
}

// --- below it

struct Meter {
  const char* title;
  const std::deque<double>& values;
  // The full height stands for this value at least, so that noise about zero does not look large.
  double least_top;
  const char* unit;
};

// The next round number, so that a scale does not jump with every sample and a steady value does
// not fill it.
double scale_for(double value) {
  const double decade = std::pow(10, std::floor(std::log10(value)));
  for (const double step : {1.0, 1.5, 2.0, 3.0, 5.0, 7.5}) {
    if (value <= step * decade) return step * decade;
  }
  return 10 * decade;
}

Line sparklines(const LinksHistory::Series& series, const Canvas& canvas) {
  const std::array<Meter, 3> meters = {Meter{"RTT", series.rtt_ms, 1, "ms"},
                                       Meter{"UP", series.rate_mbit, 1, "Mbit/s"},
                                       Meter{"LOSS", series.loss_percent, 1, "%"}};
  const std::size_t each = (canvas.width - kIndent) / meters.size();
  Line line{{std::string(kIndent, ' ')}};
  for (const Meter& m : meters) {
    double most = m.least_top;
    for (const double v : m.values) most = std::max(most, v);
    const double top = scale_for(most);
    const std::string unit = fmt::format(" ≤{:.{}f} {}", top, top < 10 ? 1 : 0, m.unit);
    const std::string title = std::string(m.title) + " ";
    const std::size_t used = columns(title) + columns(unit) + 2;
    const std::size_t width = each > used ? each - used : 0;
    line.push_back({title, Style::kDim});
    line.push_back({sparkline(m.values, top, width, canvas.unicode), Style::kAccent});
    line.push_back({fitted(unit, columns(unit) + 2), Style::kDim});
  }
  return line;
}

Line scores(const LinkState& state, const Canvas& canvas) {
  struct Score {
    const char* title;
    double value;
  };
  const std::array<Score, 4> all = {
      Score{"delay", state.nature.delay}, Score{"bandwidth", state.nature.bandwidth},
      Score{"reliability", state.nature.reliability}, Score{"security", state.nature.security}};
  std::size_t used = kIndent;
  for (const Score& s : all) used += columns(s.title) + 8;
  const std::size_t width =
      std::min<std::size_t>(12, canvas.width > used ? (canvas.width - used) / all.size() : 0);
  Line line{{std::string(kIndent, ' ')}};
  for (const Score& s : all) {
    line.push_back({std::string(s.title) + " ", Style::kDim});
    line.push_back({bar(s.value, width, canvas.unicode), Style::kGood});
    line.push_back({fmt::format(" {:.2f}  ", s.value)});
  }
  return line;
}

std::string clock_text(std::int64_t unix_ms) {
  const std::time_t seconds = unix_ms / 1000;
  std::tm parts{};
  ::localtime_r(&seconds, &parts);
  return fmt::format("{:02}:{:02}:{:02}", parts.tm_hour, parts.tm_min, parts.tm_sec);
}

Line event_line(const LinkEvent& event, const LinksSnapshot& now, const Canvas& canvas) {
  const std::int64_t ago =
      std::chrono::duration_cast<std::chrono::milliseconds>(now.at - event.at).count();
  const bool fine = event.to == "ready" || event.to == "ok";
  return {{std::string(kIndent, ' ') + clock_text(now.unix_ms - ago) + "  ", Style::kDim},
          {fitted(event.nic, 11) + " ", Style::kBold},
          {event.from + (canvas.unicode ? " → " : " -> "), Style::kDim},
          {event.to, fine ? Style::kGood : Style::kWarn},
          {"  " + event.reason}};
}

// --- lines

Line cut(const Line& line, std::size_t width) {
  Line out;
  std::size_t left = width;
  for (const Span& span : line) {
    const std::size_t have = columns(span.text);
    if (left == 0) break;
    out.push_back({have > left ? fitted(span.text, left) : span.text, span.style});
    left -= std::min(left, have);
  }
  return out;
}

Line title(const LinksSnapshot& now, const Canvas& canvas) {
  const std::string left =
      " interneuron top   " +
      (now.source.empty() ? "nothing is measured here; give --peer HOST" : now.source);
  const std::string right = clock_text(now.unix_ms) + "   q quits ";
  const std::size_t room = canvas.width > columns(right) ? canvas.width - columns(right) : 0;
  return {{fitted(left, room) + right, Style::kTitle}};
}

Line rule(const std::string& name, const Canvas& canvas) {
  std::string text = (canvas.unicode ? "── " : "-- ") + name + " ";
  while (columns(text) < canvas.width) text += canvas.unicode ? "─" : "-";
  return {{text, Style::kDim}};
}

// A card that nobody measures is one line: why it is not ready, or where it is reached.
Line plain_row(const LinkRow& row) {
  const NicFacts& f = row.facts;
  const bool ready = f.state == NicState::kReady;
  return {{std::string(kIndent, ' ')},
          {fitted(f.nic.name, 11) + " " + fitted(f.nic.kind, 8) + " ", Style::kDim},
          {fitted(std::string(to_string(f.state)), 10) + " ", style_of(f.state)},
          {ready || f.reason.empty() ? address_text(f.nic.addresses) : f.reason, Style::kDim}};
}

std::vector<Line> block(const LinkRow& row, const LinksHistory& history, const Canvas& canvas,
                        const std::vector<const Column*>& shown) {
  if (!row.measured) return {plain_row(row)};
  Line cells{{std::string(kIndent, ' ')}};
  for (const Column* column : shown) {
    Span span = column->cell(row);
    span.text = fitted(span.text, column->width, column->right) + " ";
    cells.push_back(std::move(span));
  }
  std::vector<Line> lines{cells};
  const Measured& m = *row.measured;
  if (m.state.path != PathState::kOk && !m.path_reason.empty()) {
    lines.push_back(
        {{std::string(kIndent, ' ')},
         {std::string(to_string(m.state.path)) + ": " + m.path_reason, style_of(m.state.path)}});
  }
  lines.push_back(sparklines(history.series(row), canvas));
  lines.push_back(scores(m.state, canvas));
  lines.emplace_back();
  return lines;
}

}  // namespace

std::vector<Line> draw(const LinksHistory& history, const Canvas& given) {
  const LinksSnapshot& now = history.newest();
  Canvas canvas = given;
  // Columns beyond the window are cut off below.
  canvas.width = std::max(kMinWidth, given.width);
  const auto shown = columns_that_fit(canvas.width);
  std::vector<Line> lines{title(now, canvas), {}};
  Line head{{std::string(kIndent, ' ')}};
  for (const Column* c : shown) {
    head.push_back({fitted(c->title, c->width, c->right) + " ", Style::kDim});
  }
  lines.push_back(head);

  const std::size_t events = history.events().size();
  const std::size_t log = 1 + std::max<std::size_t>(1, std::min(events, kMinLog - 1));
  const std::size_t room = canvas.height > log ? canvas.height - log : 0;
  std::size_t left_out = 0;
  for (const LinkRow* row : in_order(now)) {
    const auto add = block(*row, history, canvas, shown);
    // One line stays for the links that are left out.
    if (canvas.height > 0 && (left_out > 0 || lines.size() + add.size() >= room)) {
      ++left_out;
      continue;
    }
    lines.insert(lines.end(), add.begin(), add.end());
  }
  if (left_out > 0) {
    lines.push_back(
        {{fmt::format("  … {} more; a taller window shows them", left_out), Style::kWarn}});
  }
  if (!lines.back().empty()) lines.emplace_back();
  const auto ledgers = ledger_lines(now.programs);
  // Without room for them and the newest changes they are left out.
  if (!ledgers.empty() && (canvas.height == 0 || lines.size() + ledgers.size() + 2 < room)) {
    lines.push_back(rule("peers", canvas));
    lines.insert(lines.end(), ledgers.begin(), ledgers.end());
    lines.emplace_back();
  }
  lines.push_back(rule("changes, newest first", canvas));
  if (events == 0) lines.push_back({{"  none so far", Style::kDim}});
  for (auto event = history.events().rbegin(); event != history.events().rend(); ++event) {
    lines.push_back(event_line(*event, now, canvas));
  }
  if (canvas.height > 0 && lines.size() > canvas.height) lines.resize(canvas.height);
  for (Line& line : lines) {
    line = cut(line, given.width);
    if (canvas.unicode) continue;
    for (Span& span : line) span.text = ascii(span.text);
  }
  return lines;
}

std::string plain_text(const std::vector<Line>& lines) {
  std::string out;
  for (const Line& line : lines) {
    std::string text;
    for (const Span& span : line) text += span.text;
    text.erase(text.find_last_not_of(' ') + 1);
    out += text + '\n';
  }
  return out;
}

}  // namespace interneuron::watch
