// What an experiment comes to: one JSON file (docs/schema/eval.json) of tables and series. A table
// brings its columns along, so that the terminal and the report's page show it alike.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "lab/files/run_files.h"

namespace interneuron::cli::eval {

inline constexpr const char* kSchema = "interneuron.eval/1";

struct Column {
  std::string key;    // JSON pointer into a row: "/e2e_ms/p50"
  std::string title;  // with the unit: "e2e p50, ms"
  int decimals = 0;
  bool percent = false;  // a share, shown in per cent
};

Json table(const std::string& name, const std::string& title, const std::string& about,
           const std::vector<Column>& columns, const Json& rows);

// One cell as text: "–" for null, "low to high" for two numbers.
std::string cell_text(const Json& row, const Json& column);

// Whether a column is of words, set to the left.
bool is_text(const Json& rows, const Json& column);

// The tables of a document, on stdout.
void print_document(const Json& document);

// Finds a table by name; nullptr: there is none.
const Json* find_table(const Json& document, const std::string& name);

}  // namespace interneuron::cli::eval
