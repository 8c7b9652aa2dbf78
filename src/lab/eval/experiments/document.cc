#include "lab/eval/experiments/document.h"

#include <fmt/format.h>

#include <algorithm>

namespace interneuron::experiments {
namespace {

using records::Json;

constexpr const char* kNothing = "–";

// The characters of UTF-8 text: its bytes that begin one.
std::size_t width(const std::string& text) {
  return static_cast<std::size_t>(
      std::ranges::count_if(text, [](char c) { return (c & 0xc0) != 0x80; }));
}

std::string padded(const std::string& text, std::size_t to, bool left) {
  const std::string fill(to - std::min(to, width(text)), ' ');
  return left ? text + fill : fill + text;
}

std::string number_text(const Json& value, const Column& column) {
  if (value.is_null()) return kNothing;
  if (value.is_number_integer() && !column.percent)
    return std::to_string(value.get<std::int64_t>());
  const double scale = column.percent ? 100 : 1;
  return fmt::format("{:.{}f}", value.get<double>() * scale, column.decimals);
}

void print_table_of(const Table& table) {
  fmt::print("\n{}\n", table.title);
  const Grid grid = grid_of(table);
  std::vector<std::vector<std::string>> lines(grid.lines.size() + 1);
  for (std::size_t c = 0; c < table.columns.size(); ++c) {
    lines.front().push_back(table.columns[c].title);
    std::size_t widest = width(table.columns[c].title);
    for (std::size_t i = 0; i < grid.lines.size(); ++i) {
      lines[i + 1].push_back(grid.lines[i].cells[c]);
      widest = std::max(widest, width(grid.lines[i].cells[c]));
    }
    for (auto& line : lines) line.back() = padded(line.back(), widest, grid.is_text[c]);
  }
  for (const auto& cells : lines) {
    std::string line = fmt::format("  {}", fmt::join(cells, "  "));
    line.erase(line.find_last_not_of(' ') + 1);
    fmt::print("{}\n", line);
  }
}

}  // namespace

std::string cell_text(const Json& row, const Column& column) {
  const Json::json_pointer at(column.key);
  if (!row.contains(at)) return kNothing;
  const Json& value = row[at];
  if (value.is_string()) return value.get<std::string>();
  if (value.is_boolean()) return value.get<bool>() ? "yes" : "no";
  if (value.is_array() && value.size() == 2) {
    return number_text(value[0], column) + " to " + number_text(value[1], column);
  }
  return number_text(value, column);
}

Grid grid_of(const Table& table) {
  const Json rows = rows_json(table.rows);
  Grid out;
  for (const Json& row : rows) out.lines.push_back({row.value("name", ""), {}});
  for (const Column& column : table.columns) {
    const Json::json_pointer at(column.key);
    out.is_text.push_back(std::ranges::any_of(
        rows, [&at](const Json& row) { return row.contains(at) && row[at].is_string(); }));
    for (std::size_t i = 0; i < rows.size(); ++i) {
      out.lines[i].cells.push_back(cell_text(rows[i], column));
    }
  }
  return out;
}

void print_document(const Document& document) {
  fmt::print("\n{}: {}\n", document.experiment, document.title);
  for (const Table& table : document.tables) print_table_of(table);
  for (const std::string& note : document.notes) fmt::print("note: {}\n", note);
}

const Table* find_table(const Document& document, const std::string& name) {
  const auto found = std::ranges::find(document.tables, name, &Table::name);
  return found == document.tables.end() ? nullptr : &*found;
}

}  // namespace interneuron::experiments
