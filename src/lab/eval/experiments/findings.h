// What the rows of a document say, in words: whether the aims are met, and where a baseline wins or
// comes within noise. Computed from the rows alone.
#pragma once

#include <string>
#include <vector>

#include "lab/files/run_files.h"

namespace interneuron::cli::eval {

struct Finding {
  enum class Kind { kMet, kMissed, kNotice } kind = Kind::kNotice;
  std::string text;  // one sentence
};

std::vector<Finding> findings(const Json& document);
const char* mark(Finding::Kind kind);  // "met:", "MISSED:", "note:", padded

}  // namespace interneuron::cli::eval
