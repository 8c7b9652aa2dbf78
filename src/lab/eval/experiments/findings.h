// What the rows of a document say, in words: whether the aims are met, and where a baseline wins or
// comes within noise. Computed from the rows alone.
#pragma once

#include <string>
#include <vector>

#include "lab/eval/experiments/document.h"

namespace interneuron::experiments {

struct Finding {
  enum class Kind { kMet, kMissed, kNotice } kind = Kind::kNotice;
  // One sentence.
  std::string text;
};

std::vector<Finding> findings(const Document& document);
// "met:", "MISSED:" or "note:", all of one width.
const char* mark(Finding::Kind kind);

}  // namespace interneuron::experiments
