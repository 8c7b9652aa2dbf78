// What both files of findings need.
#pragma once

#include <string>
#include <vector>

#include "lab/eval/experiments/findings.h"

namespace interneuron::experiments {

using Findings = std::vector<Finding>;

inline Finding judged(bool met, const std::string& text) {
  return {met ? Finding::Kind::kMet : Finding::Kind::kMissed, text};
}

// One kind of document each.
void of_erdos(const Document& document, Findings& out);
void of_lidar(const Document& document, Findings& out);
void of_sweep(const Document& document, Findings& out);
void of_ladder(const Document& document, Findings& out);
void of_handler(const Document& document, Findings& out);

}  // namespace interneuron::experiments
