#include "app/watch/table.h"

#include <fmt/format.h>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "node/io/address.h"

namespace interneuron::watch {
namespace {

// The columns of an address or name at the most.
constexpr std::size_t kMaxCell = 40;

// Rows of cells with columns as wide as they need.
class Table {
 public:
  // A column whose name starts with '>' is aligned to the right.
  explicit Table(std::vector<std::string> header) {
    for (std::string& name : header) {
      right_.push_back(name.starts_with('>'));
      if (right_.back()) name.erase(0, 1);
    }
    rows_.push_back(std::move(header));
  }
  void add(std::vector<std::string> row) { rows_.push_back(std::move(row)); }
  std::string text() const {
    std::vector<std::size_t> widths(right_.size());
    for (const auto& row : rows_) {
      for (std::size_t i = 0; i < row.size(); ++i) {
        widths[i] = std::min(kMaxCell, std::max(widths[i], columns(row[i])));
      }
    }
    std::string out;
    for (const auto& row : rows_) {
      std::string line;
      for (std::size_t i = 0; i < row.size(); ++i) {
        if (i > 0) line += "  ";
        line += fitted(row[i], widths[i], right_[i]);
      }
      line.erase(line.find_last_not_of(' ') + 1);
      out += line + '\n';
    }
    return out;
  }

 private:
  std::vector<bool> right_;
  std::vector<std::vector<std::string>> rows_;
};

std::string or_nothing(const std::string& text) { return text.empty() ? kNothing : text; }

std::string score_text(const Measured& m, double Nature::*field) {
  if (m.state.age == Duration::max()) return kNothing;
  return fmt::format("{:.2f}", m.state.nature.*field);
}

std::vector<std::string> measured_cells(const LinkRow& row, bool with_program) {
  std::vector<std::string> cells{row.facts.nic.name};
  if (!row.measured) {
    cells.resize(with_program ? 14 : 13, kNothing);
    return cells;
  }
  const Measured& m = *row.measured;
  const LinkState& s = m.state;
  const bool heard = s.age != Duration::max();
  if (with_program) cells.push_back(fmt::format("{} {}", m.program, m.peer));
  cells.insert(
      cells.end(),
      {std::string(to_string(s.path)), ms_text(s.rtt_p50), ms_text(s.rtt_p95), ms_text(s.jitter),
       heard ? percent_text(s.loss) : kNothing, mbit_text(s.rate), mbit_text(s.rate_down),
       age_text(s.age), score_text(m, &Nature::delay), score_text(m, &Nature::bandwidth),
       score_text(m, &Nature::reliability), score_text(m, &Nature::security)});
  return cells;
}

std::string nic_table(const LinksSnapshot& snapshot) {
  Table table({"NIC", "KIND", "STATE", "ADDRESS", "GATEWAY", ">MTU", "OPER", "DRIVER"});
  std::string last;
  for (const LinkRow& row : snapshot.rows) {
    const io::Nic& nic = row.facts.nic;
    if (nic.name == last || !is_of_interest(row)) continue;
    last = nic.name;
    table.add({nic.name, or_nothing(nic.kind), std::string(to_string(row.facts.state)),
               address_text(nic.addresses), address_text(nic.gateways), std::to_string(nic.mtu),
               or_nothing(nic.operstate), or_nothing(nic.driver)});
  }
  return table.text();
}

std::string measured_table(const LinksSnapshot& snapshot) {
  // With one program and one peer there is nothing to tell apart.
  const Measured* first = nullptr;
  bool several = false;
  for (const LinkRow& row : snapshot.rows) {
    if (!row.measured) continue;
    if (first == nullptr) first = &*row.measured;
    several |= row.measured->program != first->program || row.measured->peer != first->peer;
  }
  std::vector<std::string> header{"NIC"};
  if (several) header.emplace_back("BY, PEER");
  for (const char* name : {"PATH", ">RTT p50", ">p95 ms", ">JITTER", ">LOSS %", ">UP",
                           ">DOWN Mbit/s", ">AGE", ">DELAY", ">BANDW", ">RELIAB", ">SECUR"}) {
    header.emplace_back(name);
  }
  Table table(header);
  for (const LinkRow& row : snapshot.rows) {
    if (is_of_interest(row)) table.add(measured_cells(row, several));
  }
  return table.text();
}

std::string reasons(const LinksSnapshot& snapshot) {
  std::string out;
  std::string last;
  for (const LinkRow& row : snapshot.rows) {
    const NicFacts& f = row.facts;
    if (!is_of_interest(row)) continue;
    if (f.state != NicState::kReady && !f.reason.empty() && f.nic.name != last) {
      out += fmt::format("{}: {}: {}\n", f.nic.name, to_string(f.state), f.reason);
    }
    last = f.nic.name;
    if (row.measured && row.measured->state.path != PathState::kOk &&
        !row.measured->path_reason.empty()) {
      out += fmt::format("{}: {}: {}\n", f.nic.name, to_string(row.measured->state.path),
                         row.measured->path_reason);
    }
  }
  return out.empty() ? out : "\n" + out;
}

constexpr std::array kEighths = {"▁", "▂", "▃", "▄", "▅", "▆", "▇", "█"};
constexpr std::array kAscii = {"_", ".", ":", "-", "=", "+", "*", "#"};

}  // namespace

std::string ms_text(Duration d) {
  if (d <= Duration::zero()) return kNothing;
  const double ms = to_ms(d);
  return ms < 1     ? fmt::format("{:.2f}", ms)
         : ms < 100 ? fmt::format("{:.1f}", ms)
                    : fmt::format("{:.0f}", ms);
}

std::string mbit_text(DataRate rate) {
  if (rate.bits_per_second <= 0) return kNothing;
  return rate.mbit() < 100 ? fmt::format("{:.1f}", rate.mbit())
                           : fmt::format("{:.0f}", rate.mbit());
}

std::string percent_text(double share) {
  return share < 0.9995 ? fmt::format("{:.1f}", share * 100) : "100";
}

std::string age_text(Duration age) {
  if (age == Duration::max()) return kNothing;
  const double s = to_ms(age) / 1000;
  if (s < 10) return fmt::format("{:.1f}s", s);
  return s < 120 ? fmt::format("{:.0f}s", s) : fmt::format("{:.0f}m", s / 60);
}

std::size_t columns(std::string_view text) {
  return static_cast<std::size_t>(
      std::ranges::count_if(text, [](char c) { return (c & 0xc0) != 0x80; }));
}

std::string fitted(const std::string& text, std::size_t width, bool right) {
  const std::size_t have = columns(text);
  if (have <= width) {
    const std::string blanks(width - have, ' ');
    return right ? blanks + text : text + blanks;
  }
  if (width == 0) return "";
  std::string out;
  std::size_t count = 0;
  for (const char c : text) {
    if ((c & 0xc0) != 0x80 && ++count == width) break;
    out += c;
  }
  return out + "…";
}

std::string address_text(const std::vector<Address>& addresses) {
  if (addresses.empty()) return kNothing;
  auto best = std::ranges::find_if(addresses, [](const Address& a) { return !is_link_local(a); });
  if (best == addresses.end()) best = addresses.begin();
  std::string text = io::host_text(*best);
  if (addresses.size() > 1) text += fmt::format(" +{}", addresses.size() - 1);
  return text;
}

std::string links_table(const LinksSnapshot& snapshot) {
  const bool measured = std::ranges::any_of(
      snapshot.rows, [](const LinkRow& row) { return row.measured.has_value(); });
  std::string text = nic_table(snapshot) + "\n";
  text += measured_table(snapshot) + reasons(snapshot);
  text += "\n";
  text += measured ? snapshot.source + "\n"
                   : "Nothing is measured: no `interneuron vehicle` or `road` runs here; give "
                     "--peer HOST to measure towards a roadside unit.\n";
  return text;
}

std::string sparkline(const std::deque<double>& values, double top, std::size_t width,
                      bool unicode) {
  const std::size_t count = std::min(values.size(), width);
  std::string out(width - count, ' ');
  const auto& glyphs = unicode ? kEighths : kAscii;
  for (std::size_t i = values.size() - count; i < values.size(); ++i) {
    if (values[i] < 0) {
      out += ' ';
      continue;
    }
    const double level = top > 0 ? values[i] / top * static_cast<double>(glyphs.size() - 1) : 0;
    const auto index = static_cast<std::size_t>(std::lround(std::max(0.0, level)));
    out += glyphs[std::min(index, glyphs.size() - 1)];
  }
  return out;
}

std::string bar(double share, std::size_t width, bool unicode) {
  static constexpr std::array kParts = {"", "▏", "▎", "▍", "▌", "▋", "▊", "▉"};
  const double filled = std::clamp(share, 0.0, 1.0) * static_cast<double>(width);
  auto whole = static_cast<std::size_t>(filled);
  if (!unicode) {
    whole = static_cast<std::size_t>(std::lround(filled));
    return std::string(whole, '#') + std::string(width - whole, '.');
  }
  std::string out;
  for (std::size_t i = 0; i < whole; ++i) out += "█";
  std::size_t used = whole;
  if (used < width) {
    const auto part = static_cast<std::size_t>((filled - static_cast<double>(whole)) * 8);
    if (part > 0) {
      out += kParts[part];
      ++used;
    }
  }
  for (; used < width; ++used) out += "·";
  return out;
}

// Column for column.
std::string ascii(const std::string& text) {
  static const std::map<std::string, char> known = {{"–", '-'}, {"…", '~'}, {"≤", '<'}};
  std::string out;
  for (std::size_t i = 0; i < text.size();) {
    std::size_t end = i + 1;
    while (end < text.size() && (text[end] & 0xc0) == 0x80) ++end;
    const auto found = known.find(text.substr(i, end - i));
    out += end - i == 1 ? text[i] : found != known.end() ? found->second : '?';
    i = end;
  }
  return out;
}

}  // namespace interneuron::watch
