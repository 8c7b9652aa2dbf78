#include "lab/eval/experiments/document.h"

#include <fmt/format.h>

#include <algorithm>

namespace interneuron::cli::eval {
namespace {

constexpr const char* kNothing = "–";

// Of UTF-8 text: bytes that begin a character.
std::size_t width(const std::string& text) {
  return static_cast<std::size_t>(
      std::ranges::count_if(text, [](char c) { return (c & 0xc0) != 0x80; }));
}

std::string padded(const std::string& text, std::size_t to, bool left) {
  const std::string fill(to - std::min(to, width(text)), ' ');
  return left ? text + fill : fill + text;
}

std::string number_text(const Json& value, const Json& column) {
  if (value.is_null()) return kNothing;
  if (value.is_number_integer() && !column.value("percent", false)) {
    return std::to_string(value.get<std::int64_t>());
  }
  const double scale = column.value("percent", false) ? 100 : 1;
  return fmt::format("{:.{}f}", value.get<double>() * scale, column.value("decimals", 0));
}

void print_table_of(const Json& table) {
  fmt::print("\n{}\n", table["title"].get<std::string>());
  std::vector<std::vector<std::string>> lines(table["rows"].size());
  std::vector<std::string> texts;
  for (const Json& column : table["columns"]) {
    const bool left = is_text(table["rows"], column);
    const std::string title = column["title"].get<std::string>();
    std::size_t widest = width(title);
    for (std::size_t i = 0; i < lines.size(); ++i) {
      lines[i].push_back(cell_text(table["rows"][i], column));
      widest = std::max(widest, width(lines[i].back()));
    }
    texts.push_back(padded(title, widest, left));
    for (auto& line : lines) line.back() = padded(line.back(), widest, left);
  }
  const auto print_line = [](const std::vector<std::string>& cells) {
    std::string line = fmt::format("  {}", fmt::join(cells, "  "));
    line.erase(line.find_last_not_of(' ') + 1);
    fmt::print("{}\n", line);
  };
  print_line(texts);
  for (const auto& line : lines) print_line(line);
}

}  // namespace

Json table(const std::string& name, const std::string& title, const std::string& about,
           const std::vector<Column>& columns, const Json& rows) {
  Json out{{"name", name}, {"title", title}, {"about", about}, {"columns", Json::array()}};
  for (const Column& c : columns) {
    Json column{{"key", c.key}, {"title", c.title}, {"decimals", c.decimals}};
    if (c.percent) column["percent"] = true;
    out["columns"].push_back(std::move(column));
  }
  out["rows"] = rows;
  return out;
}

std::string cell_text(const Json& row, const Json& column) {
  const Json::json_pointer at(column["key"].get<std::string>());
  if (!row.contains(at)) return kNothing;
  const Json& value = row[at];
  if (value.is_string()) return value.get<std::string>();
  if (value.is_boolean()) return value.get<bool>() ? "yes" : "no";
  if (value.is_array() && value.size() == 2) {
    return number_text(value[0], column) + " to " + number_text(value[1], column);
  }
  return number_text(value, column);
}

bool is_text(const Json& rows, const Json& column) {
  const Json::json_pointer at(column["key"].get<std::string>());
  return std::ranges::any_of(
      rows, [&at](const Json& row) { return row.contains(at) && row[at].is_string(); });
}

void print_document(const Json& document) {
  fmt::print("\n{}: {}\n", document["experiment"].get<std::string>(),
             document["title"].get<std::string>());
  for (const Json& table : document["tables"]) print_table_of(table);
  for (const Json& note : document["notes"]) fmt::print("note: {}\n", note.get<std::string>());
}

const Json* find_table(const Json& document, const std::string& name) {
  for (const Json& table : document["tables"]) {
    if (table["name"] == name) return &table;
  }
  return nullptr;
}

}  // namespace interneuron::cli::eval
