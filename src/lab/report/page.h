// The report's page: one HTML file that asks nobody for anything, for light and dark screens and
// for telephones, well-formed as XML too. Its HTML is in report.html.
#pragma once

#include <filesystem>
#include <initializer_list>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "lab/eval/experiments/document.h"
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

// What the report says first: three sentences of what was compared, who wins and by how much,
// computed from the rows of `table-erdos`. Pure. Empty for a document that has no table of ours
// beside erdos_like.
std::vector<std::string> headline(const experiments::Document& document);

using Values = std::initializer_list<std::pair<const char*, std::string>>;
// The report's HTML, from one file: report.html, compiled in. It consists of blocks, each behind a
// line "<!--# NAME -->". Within a block, {{key}} stands for a text, which is escaped, and {{{key}}}
// for HTML, which is not. Thread-safe.
//
// Returns the block of this name with its keys replaced. A block or a key that is not there is a
// bug of ours: std::logic_error, which names it.
std::string filled(const std::string& block, Values values);

// Text between tags or in an attribute.
std::string escaped(const std::string& text);

// Bytes by RFC 4648, for addresses that begin with "data:".
std::string base64(const std::string& bytes);

// Frames of the demo video with the boxes that an application gets of them. Empty, with the reason
// in `missing`, when video, recordings or ground truth are not there. Throws process::Failure (1)
// when a folder that the user named lacks them, or files are damaged.
std::vector<Picture> pictures(const std::optional<std::filesystem::path>& data, bool named,
                              std::string& missing);

}  // namespace interneuron::report
