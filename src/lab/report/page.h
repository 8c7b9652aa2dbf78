// The report's page: one HTML file that asks nobody for anything, for light and dark screens and
// for telephones, well-formed as XML too. Its HTML is in report.html.
#pragma once

#include <string>
#include <vector>

#include "lab/eval/experiments/findings.h"
#include "lab/report/figure.h"

namespace interneuron::report {

struct Picture {
  std::string caption;
  // The bytes of the file.
  std::string png;
};

// One experiment.
struct Section {
  Document document;
  std::vector<experiments::Finding> findings;
  std::vector<Figure> figures;
  // One per figure, to be put into the page.
  std::vector<std::string> svgs;
};

// `pictures_missing`: why there are none, when there are none.
std::string page(const std::vector<Section>& sections, const std::vector<Picture>& pictures,
                 const std::string& pictures_missing);

}  // namespace interneuron::report
