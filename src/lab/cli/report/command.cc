#include "lab/cli/commands.h"

#include <fmt/format.h>

#include <memory>

#include "app/process/failure.h"
#include "app/process/progress.h"
#include "app/process/signals.h"
#include "app/process/whole_file.h"
#include "app/records/staging.h"
#include "app/settings/data.h"
#include "lab/cli/eval/experiments.h"
#include "lab/eval/experiments/document.h"
#include "lab/report/figure.h"
#include "lab/report/page.h"

namespace interneuron::cli {
namespace {

using report::Section;

namespace fs = std::filesystem;

struct ReportOptions {
  std::string folder;
  std::string data;
};

Section section_of(const fs::path& file) {
  try {
    Section section;
    section.document = experiments::document_from(records::read_json(file));
    if (section.document.experiment != file.stem().string()) {
      throw process::Failure(process::kConfiguration, "another experiment");
    }
    section.findings = experiments::findings(section.document);
    section.figures = report::figures_of(section.document);
    section.svgs.resize(section.figures.size());
    return section;
  } catch (const std::exception& error) {
    throw process::Failure(process::kConfiguration,
                           "'" + file.string() + "': not an evaluation of this version (" +
                               error.what() + "); run `interneuron eval` again");
  }
}

// In the order of the experiments.
std::vector<Section> sections_of(const fs::path& folder) {
  if (!fs::is_directory(folder)) {
    throw process::Failure(
        process::kConfiguration,
        "'" + folder.string() + "' is no folder; `interneuron eval all` makes " + "out/eval");
  }
  std::vector<Section> out;
  for (const experiments::Experiment& experiment : all_experiments()) {
    const fs::path file = folder / (std::string(experiment.name) + ".json");
    if (fs::exists(file)) out.push_back(section_of(file));
  }
  if (out.empty()) {
    throw process::Failure(process::kConfiguration,
                           "no experiment in '" + folder.string() +
                               "'; run `interneuron eval EXPERIMENT --out " + folder.string() +
                               "` first");
  }
  return out;
}

int run_report(const ReportOptions& o) {
  std::vector<Section> sections = sections_of(o.folder);
  const process::SignalWatch signals;
  records::Staging staging(o.folder);
  // By section and figure.
  std::vector<std::pair<std::size_t, std::size_t>> all;
  for (std::size_t s = 0; s < sections.size(); ++s) {
    for (std::size_t i = 0; i < sections[s].figures.size(); ++i) all.emplace_back(s, i);
  }
  process::Progress progress;
  progress.for_each("figures", all.size(), [&](std::size_t i) {
    Section& section = sections[all[i].first];
    const report::Figure& figure = section.figures[all[i].second];
    report::draw_figure(staging / "", figure);
    section.svgs[all[i].second] = report::inline_svg(staging / "", figure);
  });
  std::string missing;
  const auto shots = report::pictures(settings::find_data(o.data), !o.data.empty(), missing);
  const fs::path file = staging / "report.html";
  process::write_whole(file, report::page(sections, shots, missing));
  staging.publish();
  fmt::print("written to {}: report.html, {} figures as SVG and PNG\n", o.folder, all.size());
  return process::kFine;
}

}  // namespace

void add_report(CLI::App& program, std::function<int()>& run) {
  auto o = std::make_shared<ReportOptions>();
  CLI::App* c = program.add_subcommand(
      "report",
      "One self-contained HTML page of an evaluation's folder, every figure as SVG and PNG");
  c->add_option("DIR", o->folder, "Folder that `interneuron eval` has written to")->required();
  c->add_option("--data", o->data,
                "Folder with the demo video and recorded detections, for the pictures (default: "
                "INTERNEURON_DATA, ../shared/data, build/data)");
  c->footer("Example:\n  interneuron eval all && interneuron report out/eval");
  c->callback([&run, o] { run = [o] { return run_report(*o); }; });
}

}  // namespace interneuron::cli
