// What an experiment comes to: tables, series, waterfalls and notes, and the JSON file that holds
// them (docs/schema/eval.json). A table brings its columns along, so that the terminal and the
// report's page show it alike. Plain values.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "app/records/json_file.h"
#include "lab/eval/experiments/rows.h"

namespace interneuron::experiments {

inline constexpr const char* kSchema = "interneuron.eval/1";

struct Column {
  // A JSON pointer into a row as the file has it: "/e2e_ms/p50".
  std::string key;
  // With the unit: "e2e p50, ms".
  std::string title;
  int decimals = 0;
  // A share, shown in per cent.
  bool percent = false;
};

struct Table {
  std::string name;
  std::string title;
  // The conditions in one line.
  std::string about;
  std::vector<Column> columns;
  Rows rows;
};

struct Point {
  double x = 0;
  double y = 0;
  // Whether the round, whose number is x, was answered remotely in time.
  std::optional<bool> on_time;
};

// What a figure draws beside the tables.
struct Series {
  std::string name;
  std::string unit;
  std::vector<Point> points;
};

// Where the time of one round went.
struct Waterfall {
  std::uint32_t round = 0;
  double deadline_ms = 0;
  ScriptRow stages;
  // One message over one link.
  struct Send {
    std::string link;
    // "up" or "down".
    std::string direction;
    // "raw", "sampled" or "result".
    std::string what;
    std::uint64_t fragments = 0;
    // When each fragment left, since t0.
    std::vector<double> sent_ms;
  };
  std::vector<Send> sends;
};

struct Document {
  std::string experiment;
  std::string title;
  // "sim" or "testbed".
  std::string mode;
  // Empty: nothing is drawn by lot.
  std::optional<Seeds> seeds;
  std::uint64_t rounds_per_seed = 0;
  std::vector<Table> tables;
  std::vector<Series> series;
  std::vector<Waterfall> waterfalls;
  std::vector<std::string> notes;
};

// The only places that know how a file spells a document. document_from() throws std::exception for
// what is none.
records::Json to_json(const Document& document);
Document document_from(const records::Json& json);
records::Json rows_json(const Rows& rows);

// The rows of a table whose kind is known from its experiment and name.
template <class Row>
const std::vector<Row>& rows_as(const Table& table) {
  return std::get<std::vector<Row>>(table.rows);
}

// The table of that name; nullptr: there is none.
const Table* find_table(const Document& document, const std::string& name);

// A table as text, "–" for what is not known.
struct Grid {
  // By column: whether it has words, which are set to the left.
  std::vector<bool> is_text;
  struct Line {
    // The name of the row; empty when it has none.
    std::string name;
    std::vector<std::string> cells;
  };
  std::vector<Line> lines;
};
Grid grid_of(const Table& table);

// One cell as text: "low to high" for two numbers, "yes" or "no" for a truth value.
std::string cell_text(const records::Json& row, const Column& column);

// The tables and notes of a document, on stdout.
void print_document(const Document& document);

}  // namespace interneuron::experiments
