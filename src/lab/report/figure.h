// Charts of an evaluation: scripts for gnuplot, made from the rows of a document, and drawn as SVG
// and PNG.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "app/records/plot.h"
#include "lab/eval/experiments/document.h"

namespace interneuron::report {

using experiments::Document;

struct Figure {
  // The name of its files: "table-erdos-uniform".
  std::string name;
  std::string caption;
  // Pixels.
  int width = 980;
  int height = 360;
  // For gnuplot, without terminal and output.
  std::string script;
  // Whether the page shows it first, with letters that can be read on a telephone.
  bool is_headline = false;
};

// All of one document, in order.
std::vector<Figure> figures_of(const Document& document);

// The kinds of documents, one file each.
// Those of table-erdos, table-lidar, ladder and timeout-handler.
std::vector<Figure> system_figures(const Document& document);
std::vector<Figure> sweep_figures(const Document& document);
std::vector<Figure> adjust_figures(const Document& document);
std::vector<Figure> network_figures(const Document& document);
std::vector<Figure> rt_figures(const Document& document);

// Dots with intervals, one row per label, panels side by side.
struct Dot {
  double value = 0;
  // Both are the value itself where there is no interval.
  double low = 0;
  double high = 0;
};
struct Dots {
  // Empty: not in the key.
  std::string title;
  std::string colour;
  // By label.
  std::vector<std::optional<Dot>> dots;
  bool hollow = false;
};
struct Panel {
  std::string title;
  std::vector<Dots> series;
  bool logarithmic = false;
  bool zero_line = false;
  // The distance between the tics of the axis; 0: as gnuplot has it.
  double tics = 0;
};
std::string dot_panels(const std::vector<std::string>& labels, const std::vector<Panel>& panels);
int dots_height(std::size_t labels);

inline constexpr const char* kBlue = "#3f7fc9";
inline constexpr const char* kOrange = "#d9822b";
inline constexpr const char* kGreen = "#3d9a5f";
inline constexpr const char* kPurple = "#9463c4";
inline constexpr const char* kRed = "#d0384a";
inline constexpr const char* kGrey = "#8a8f98";

// Writes FOLDER/NAME.svg and .png. The SVG's ink is currentColor, so that it shows on light and
// dark pages. Throws process::Failure (1), also without gnuplot.
void draw_figure(const std::filesystem::path& folder, const Figure& figure);

// That SVG to be put into a page: without prologue and addresses, its ids made the figure's own.
std::string inline_svg(const std::filesystem::path& folder, const Figure& figure);

using records::gnuplot_text;

}  // namespace interneuron::report
