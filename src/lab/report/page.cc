#include "lab/report/page.h"

#include <fmt/format.h>

#include "lab/eval/experiments/document.h"

namespace interneuron::cli::report {
namespace {

using eval::Finding;

constexpr const char* kStyle = R"(
:root { color-scheme: light dark; --page: #ffffff; --ink: #1c2128; --soft: #5c6672; --line: #d5dae0;
  --panel: #f5f7f9; --met: #1f7a45; --missed: #b3261e; --note: #8a5a00; }
@media (prefers-color-scheme: dark) { :root { --page: #14181d; --ink: #e4e8ec; --soft: #9aa4af;
  --line: #343b44; --panel: #1c2228; --met: #5cc48a; --missed: #ff8a80; --note: #e0b050; } }
body { margin: 0 auto; padding: 1.5rem; max-width: 80rem; background: var(--page); color: var(--ink);
  font: 15px/1.5 system-ui, sans-serif; }
h1 { font-size: 1.6rem; } h2 { font-size: 1.25rem; margin-top: 2.5rem; border-top: 1px solid var(--line);
  padding-top: 1rem; } h3 { font-size: 1rem; margin: 1.5rem 0 0.3rem; }
p.about, figcaption { color: var(--soft); margin: 0.2rem 0; }
nav a { margin-right: 1rem; } a { color: inherit; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: 0.8rem; margin: 0.4rem 0; }
th, td { padding: 0.15rem 0.3rem; text-align: right; border-bottom: 1px solid var(--line); white-space: nowrap; }
th { color: var(--soft); font-weight: 600; } .text { text-align: left; }
tr.ours { background: var(--panel); font-weight: 600; }
figure { margin: 1rem 0; } figure svg { max-width: 100%; height: auto; color: var(--ink); }
.pictures { display: grid; grid-template-columns: repeat(auto-fit, minmax(20rem, 1fr)); gap: 1rem; }
.pictures img { max-width: 100%; }
ul.findings { list-style: none; padding: 0; } ul.findings li { padding: 0.1rem 0; }
.tag { display: inline-block; width: 4.5rem; font-weight: 600; }
.met { color: var(--met); } .missed { color: var(--missed); } .note { color: var(--note); }
)";

const char* class_of(Finding::Kind kind) {
  return kind == Finding::Kind::kMet ? "met" : kind == Finding::Kind::kMissed ? "missed" : "note";
}

std::string findings_list(const std::vector<Finding>& findings) {
  if (findings.empty()) return "";
  std::string out = "<ul class=\"findings\">\n";
  for (const Finding& f : findings) {
    out += fmt::format("<li><span class=\"tag {0}\">{0}</span>{1}</li>\n", class_of(f.kind),
                       escaped(f.text));
  }
  return out + "</ul>\n";
}

std::string table_html(const Json& table) {
  const Json& rows = table.at("rows");
  std::string out =
      fmt::format("<h3>{}</h3>\n<p class=\"about\">{}</p>\n<div class=\"wide\"><table>\n<tr>",
                  escaped(table.at("title")), escaped(table.at("about")));
  std::vector<const char*> classes;
  for (const Json& column : table.at("columns")) {
    classes.push_back(eval::is_text(rows, column) ? " class=\"text\"" : "");
    out += fmt::format("<th{}>{}</th>", classes.back(), escaped(column.at("title")));
  }
  out += "</tr>\n";
  for (const Json& row : rows) {
    out += row.value("name", "") == "ours" ? "<tr class=\"ours\">" : "<tr>";
    std::size_t i = 0;
    for (const Json& column : table.at("columns")) {
      out += fmt::format("<td{}>{}</td>", classes[i++], escaped(eval::cell_text(row, column)));
    }
    out += "</tr>\n";
  }
  return out + "</table></div>\n";
}

std::string conditions(const Json& document) {
  std::string out = document.at("mode") == "sim" ? "In virtual time" : "On the testbed";
  const Json& seeds = document.at("seeds");
  if (seeds.is_array()) {
    out += fmt::format("; seeds {} to {}", seeds.at(0).get<std::uint64_t>(),
                       seeds.at(1).get<std::uint64_t>());
  }
  return out + fmt::format("; {} rounds{}.", document.at("rounds_per_seed").get<std::uint64_t>(),
                           seeds.is_array() ? " per seed" : "");
}

std::string section_html(const Section& section) {
  const Json& document = section.document;
  const std::string name = document.at("experiment");
  std::string out = fmt::format(
      "<section id=\"{0}\">\n<h2>{1} <small>({0})</small></h2>\n"
      "<p class=\"about\">{2}</p>\n",
      name, escaped(document.at("title")), escaped(conditions(document)));
  out += findings_list(section.findings);
  for (const Json& table : document.at("tables")) out += table_html(table);
  for (std::size_t i = 0; i < section.figures.size(); ++i) {
    out += fmt::format("<figure>\n{}\n<figcaption>{}</figcaption>\n</figure>\n", section.svgs[i],
                       escaped(section.figures[i].caption));
  }
  for (const Json& note : document.at("notes")) {
    out += fmt::format("<p class=\"about\">Note: {}</p>\n", escaped(note));
  }
  return out + "</section>\n";
}

std::string pictures_html(const std::vector<Picture>& pictures, const std::string& missing) {
  std::string out = "<section id=\"pictures\">\n<h2>What the application sees</h2>\n";
  if (pictures.empty())
    return out +
           fmt::format("<p class=\"about\">No pictures: {}.</p>\n</section>\n", escaped(missing));
  out += "<div class=\"pictures\">\n";
  for (const Picture& p : pictures) {
    out += fmt::format(
        "<figure><img alt=\"{0}\" src=\"data:image/png;base64,{1}\"/>"
        "<figcaption>{0}</figcaption></figure>\n",
        escaped(p.caption), base64(p.png));
  }
  return out + "</div>\n</section>\n";
}

}  // namespace

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

std::string base64(const std::string& bytes) {
  constexpr char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t have = std::min<std::size_t>(3, bytes.size() - i);
    std::uint32_t three = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      three = three << 8 | (k < have ? static_cast<unsigned char>(bytes[i + k]) : 0U);
    }
    for (std::size_t k = 0; k < 4; ++k) {
      out += k <= have ? kDigits[three >> (18 - 6 * k) & 63U] : '=';
    }
  }
  return out;
}

std::string page(const std::vector<Section>& sections, const std::vector<Picture>& pictures,
                 const std::string& pictures_missing) {
  std::string links;
  std::size_t met = 0;
  std::vector<Finding> missed;
  for (const Section& s : sections) {
    links +=
        fmt::format("<a href=\"#{0}\">{0}</a>\n", s.document.at("experiment").get<std::string>());
    for (const Finding& f : s.findings) {
      if (f.kind == Finding::Kind::kMet) ++met;
      if (f.kind == Finding::Kind::kMissed) missed.push_back(f);
    }
  }
  std::string out = fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n"
      "<title>Interneuron: evaluation</title>\n<style>{}</style>\n</head>\n<body>\n"
      "<h1>Interneuron: evaluation</h1>\n<nav>{}<a href=\"#pictures\">pictures</a></nav>\n"
      "<p>{} aims are met, {} are missed{}</p>\n",
      kStyle, links, met, missed.size(), missed.empty() ? "." : ":");
  out += findings_list(missed);
  for (const Section& section : sections) out += section_html(section);
  return out + pictures_html(pictures, pictures_missing) + "</body>\n</html>\n";
}

}  // namespace interneuron::cli::report
