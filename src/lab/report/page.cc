#include "lab/report/page.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>

namespace interneuron::report {
namespace {

using experiments::Finding;

const char* class_of(Finding::Kind kind) {
  return kind == Finding::Kind::kMet ? "met" : kind == Finding::Kind::kMissed ? "missed" : "note";
}

std::size_t count(const std::vector<Finding>& findings, Finding::Kind kind) {
  return static_cast<std::size_t>(std::ranges::count(findings, kind, &Finding::kind));
}

// "12 aims met, 1 missed; 3 notes", what it counts folded behind it.
std::string folded(const std::vector<Finding>& findings) {
  if (findings.empty()) return "";
  std::string items;
  for (const Finding& f : findings) {
    items += filled("finding", {{"kind", class_of(f.kind)}, {"text", f.text}});
  }
  const std::size_t notes = count(findings, Finding::Kind::kNotice);
  return filled(
      "folded",
      {{"summary", fmt::format("{} aims met, {} missed{}", count(findings, Finding::Kind::kMet),
                               count(findings, Finding::Kind::kMissed),
                               notes > 0 ? fmt::format("; {} notes", notes) : "")},
       {"items", items}});
}

std::string table_html(const experiments::Table& table) {
  const experiments::Grid grid = grid_of(table);
  std::string cells;
  for (std::size_t c = 0; c < table.columns.size(); ++c) {
    cells += filled(grid.is_text[c] ? "head_of_words" : "head", {{"text", table.columns[c].title}});
  }
  std::string rows = filled("row", {{"cells", cells}});
  for (const auto& line : grid.lines) {
    cells.clear();
    for (std::size_t c = 0; c < line.cells.size(); ++c) {
      cells += filled(grid.is_text[c] ? "cell_of_words" : "cell", {{"text", line.cells[c]}});
    }
    rows += filled(line.name == "ours" ? "row_of_ours" : "row", {{"cells", cells}});
  }
  return filled("table", {{"title", table.title}, {"about", table.about}, {"rows", rows}});
}

std::string conditions(const Document& document) {
  std::string out = document.mode == "sim" ? "In virtual time" : "On the testbed";
  if (document.seeds) {
    out += fmt::format("; seeds {} to {}", document.seeds->first, document.seeds->last);
  }
  return out +
         fmt::format("; {} rounds{}.", document.rounds_per_seed, document.seeds ? " per seed" : "");
}

// The figures for the page's head, or the others.
std::string figures_html(const Section& section, bool headline) {
  std::string out;
  for (std::size_t i = 0; i < section.figures.size(); ++i) {
    if (section.figures[i].is_headline != headline) continue;
    out += filled(headline ? "headline_figure" : "figure",
                  {{"svg", section.svgs[i]}, {"caption", section.figures[i].caption}});
  }
  return out;
}

std::string section_html(const Section& section) {
  const Document& document = section.document;
  std::string tables;
  for (const experiments::Table& table : document.tables) tables += table_html(table);
  std::string notes;
  for (const std::string& note : document.notes) notes += filled("note", {{"text", note}});
  return filled("section", {{"name", document.experiment},
                            {"title", document.title},
                            {"conditions", conditions(document)},
                            {"findings", folded(section.findings)},
                            {"tables", tables},
                            {"figures", figures_html(section, false)},
                            {"notes", notes}});
}

std::string pictures_html(const std::vector<Picture>& pictures, const std::string& missing) {
  if (pictures.empty()) return filled("no_pictures", {{"reason", missing}});
  std::string shots;
  for (const Picture& p : pictures) {
    shots += filled("shot", {{"caption", p.caption}, {"png", base64(p.png)}});
  }
  return filled("pictures", {{"shots", shots}});
}

std::string lead_html(const std::vector<Section>& sections) {
  std::string out;
  for (const Section& section : sections) {
    if (section.document.experiment != "table-erdos") continue;
    for (const std::string& text : headline(section.document)) {
      out += filled("sentence", {{"text", text}});
    }
  }
  if (!out.empty()) return out;
  return filled("sentence", {{"text",
                              "Who wins, and by how much, is for `table-erdos` to say, "
                              "which is not among these experiments."}});
}

// The systems of all tables, each once.
std::string systems_html(const std::vector<Section>& sections) {
  std::string out;
  std::set<std::string> told;
  for (const Section& section : sections) {
    for (const experiments::Table& table : section.document.tables) {
      const auto* rows = std::get_if<std::vector<experiments::SystemRow>>(&table.rows);
      if (rows == nullptr) continue;
      for (const experiments::SystemRow& row : *rows) {
        if (!told.insert(row.name).second) continue;
        out += filled("system", {{"name", row.name}, {"about", row.about}});
      }
    }
  }
  return out;
}

}  // namespace

std::string page(const std::vector<Section>& sections, const std::vector<Picture>& pictures,
                 const std::string& pictures_missing) {
  std::string links;
  std::string figures;
  std::string html;
  std::vector<Finding> all;
  for (const Section& section : sections) {
    const std::string& name = section.document.experiment;
    links += filled("link", {{"to", name}, {"text", name}});
    figures += figures_html(section, true);
    html += section_html(section);
    all.insert(all.end(), section.findings.begin(), section.findings.end());
  }
  links += filled("link", {{"to", "glossary"}, {"text", "glossary"}});
  // The notices stand in their sections.
  std::erase_if(all, [](const Finding& f) { return f.kind == Finding::Kind::kNotice; });
  std::stable_partition(all.begin(), all.end(),
                        [](const Finding& f) { return f.kind == Finding::Kind::kMissed; });
  return filled("page", {{"links", links},
                         {"lead", lead_html(sections)},
                         {"figures", figures},
                         {"pictures", pictures_html(pictures, pictures_missing)},
                         {"missed", folded(all)},
                         {"sections", html},
                         {"glossary", filled("glossary", {{"systems", systems_html(sections)}})}});
}

std::vector<Figure> figures_of(const Document& document) {
  const std::string& experiment = document.experiment;
  if (experiment == "table-network") return network_figures(document);
  if (experiment == "fig-adjust") return adjust_figures(document);
  if (experiment == "fig-rt") return rt_figures(document);
  if (experiment == "sweep") return sweep_figures(document);
  return system_figures(document);
}

}  // namespace interneuron::report
