// What both files of findings need.
#pragma once

#include <string>
#include <vector>

#include "lab/eval/experiments/findings.h"

namespace interneuron::cli::eval {

using Findings = std::vector<Finding>;

inline Finding judged(bool met, const std::string& text) {
  return {met ? Finding::Kind::kMet : Finding::Kind::kMissed, text};
}

inline double number(const Json& row, const char* key) { return row.at(key).get<double>(); }
inline bool known(const Json& row, const char* key) {
  return row.contains(key) && row.at(key).is_number();
}

// One kind of document each.
void of_erdos(const Json& document, Findings& out);
void of_sweep(const Json& document, Findings& out);
void of_ladder(const Json& document, Findings& out);
void of_handler(const Json& document, Findings& out);

}  // namespace interneuron::cli::eval
