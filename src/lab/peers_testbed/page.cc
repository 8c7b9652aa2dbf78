#include "lab/peers_testbed/comparison.h"

#include <fmt/format.h>

#include <algorithm>

namespace interneuron::peers_testbed {
namespace {

// What is run of one scenario, size and deadline: a row for each peer.
using Column = std::vector<const Row*>;
// Columns of the same peers.
using Table = std::vector<Column>;

bool is_of(const Row& row, const Column& column) {
  const Row& first = *column.front();
  return row.scenario == first.scenario && row.message_bytes == first.message_bytes &&
         row.deadline == first.deadline;
}

bool have_same_peers(const Column& a, const Column& b) {
  return std::ranges::equal(a, b, {}, &Row::peer, &Row::peer);
}

std::vector<Table> tables_of(const std::vector<Row>& rows) {
  std::vector<Column> columns;
  for (const Row& row : rows) {
    const auto column =
        std::ranges::find_if(columns, [&row](const Column& c) { return is_of(row, c); });
    (column == columns.end() ? columns.emplace_back() : *column).push_back(&row);
  }
  std::vector<Table> tables;
  for (const Column& column : columns) {
    const auto table = std::ranges::find_if(
        tables, [&column](const Table& t) { return have_same_peers(t.front(), column); });
    (table == tables.end() ? tables.emplace_back() : *table).push_back(column);
  }
  return tables;
}

std::string bytes_of(std::size_t bytes) {
  constexpr std::size_t kKibibyte = 1024;
  return bytes % kKibibyte == 0 ? fmt::format("{} KiB", bytes / kKibibyte)
                                : fmt::format("{} KB", static_cast<double>(bytes) / 1e3);
}

std::string heading_of(const Column& column) {
  const Row& first = *column.front();
  return fmt::format("{}, {}, {:.0f} ms, {} messages", first.scenario->name,
                     bytes_of(first.message_bytes), to_ms(first.deadline), first.messages);
}

std::string cell_of(const Row& row) {
  const std::string degraded = row.degraded > 0 ? fmt::format(" ({})", row.degraded) : "";
  return fmt::format("{}{}, {:.2f}", row.missed, degraded, row.wire_ratio);
}

std::string markdown_of(const Table& table) {
  std::string head = "| |";
  std::string rule = "|---|";
  for (const Column& column : table) {
    head += fmt::format(" {} |", heading_of(column));
    rule += "---|";
  }
  std::string out = head + " µs to send, to receive |\n" + rule + "---|\n";
  for (std::size_t p = 0; p < table.front().size(); ++p) {
    const Row& first = *table.front()[p];
    out += fmt::format("| `{}` |", first.peer->name);
    for (const Column& column : table) out += fmt::format(" {} |", cell_of(*column[p]));
    const std::string receive =
        first.cpu_us_receive ? fmt::format("{:.0f}", *first.cpu_us_receive) : "–";
    out += fmt::format(" {:.0f}, {} |\n", first.cpu_us_send, receive);
  }
  return out;
}

}  // namespace

std::string page_of(const std::vector<Row>& rows) {
  std::string out;
  for (const Table& table : tables_of(rows)) {
    if (!out.empty()) out += "\n";
    out += markdown_of(table);
  }
  return out;
}

}  // namespace interneuron::peers_testbed
