#include "lab/report/page.h"

#include <algorithm>
#include <map>
#include <sstream>
#include <stdexcept>

namespace interneuron::report {

// Made of report.html by CMake.
extern const char* const kReportHtml;

namespace {

std::map<std::string, std::string> blocks_of(const char* text) {
  const std::string begin = "<!--# ";
  const std::string end = " -->";
  std::map<std::string, std::string> out;
  std::string* block = nullptr;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with(begin) && line.ends_with(end)) {
      block = &out[line.substr(begin.size(), line.size() - begin.size() - end.size())];
    } else if (block != nullptr) {
      *block += line + '\n';
    }
  }
  return out;
}

}  // namespace

std::string filled(const std::string& block, Values values) {
  static const std::map<std::string, std::string> kBlocks = blocks_of(kReportHtml);
  const auto found = kBlocks.find(block);
  if (found == kBlocks.end()) throw std::logic_error("no block " + block);
  const std::string& text = found->second;
  std::string out;
  std::size_t at = 0;
  for (std::size_t open = text.find("{{"); open != std::string::npos; open = text.find("{{", at)) {
    out.append(text, at, open - at);
    const bool html = text.compare(open, 3, "{{{") == 0;
    const std::size_t first = open + (html ? 3 : 2);
    const std::size_t close = text.find(html ? "}}}" : "}}", first);
    if (close == std::string::npos) throw std::logic_error("open key in block " + block);
    const std::string key = text.substr(first, close - first);
    const auto value = std::ranges::find(values, key, [](const auto& v) { return v.first; });
    if (value == values.end()) throw std::logic_error("no value for " + key + " in " + block);
    out += html ? value->second : escaped(value->second);
    at = close + (html ? 3 : 2);
  }
  return out + text.substr(at);
}

}  // namespace interneuron::report
