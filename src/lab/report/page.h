// The report's page: one HTML file that asks nobody for anything, for light and dark screens,
// well-formed as XML too.
#pragma once

#include <string>
#include <vector>

#include "lab/eval/experiments/findings.h"
#include "lab/files/run_files.h"
#include "lab/report/figure.h"

namespace interneuron::cli::report {

struct Picture {
  std::string caption;
  std::string png;  // the file's bytes
};

struct Section {
  Json document;
  std::vector<eval::Finding> findings;
  std::vector<Figure> figures;
  std::vector<std::string> svgs;  // inlined, one per figure
};

// `pictures_missing`: why there are none, when there are none.
std::string page(const std::vector<Section>& sections, const std::vector<Picture>& pictures,
                 const std::string& pictures_missing);

// Text between tags or in an attribute.
std::string escaped(const std::string& text);
std::string base64(const std::string& bytes);

}  // namespace interneuron::cli::report
