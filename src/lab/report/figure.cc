#include "lab/report/figure.h"

#include <fmt/format.h>

#include <algorithm>

#include "app/process/failure.h"
#include "app/process/whole_file.h"

namespace interneuron::report {
namespace {

namespace fs = std::filesystem;

constexpr const char* kStyle =
    "set border 3\nset tics nomirror out\nset grid xtics ytics lc rgb '#70888888'\n"
    "set key samplen 1\n";
// Pixels of one row of dots, and of title, axis and key around them.
constexpr int kRowHeight = 22;
constexpr int kAroundRows = 110;
// The longest name in the tables needs this share of the width.
constexpr double kLabelShare = 0.19;
constexpr double kRightMargin = 0.98;
// The share of the width between two panels.
constexpr double kGap = 0.05;
// Points. A headline is half as wide as the page, and all of a telephone.
constexpr int kFont = 12;
constexpr int kHeadlineFont = 14;

void replace_all(std::string& text, const std::string& from, const std::string& to) {
  for (std::size_t at = text.find(from); at != std::string::npos;
       at = text.find(from, at + to.size())) {
    text.replace(at, from.size(), to);
  }
}

// gnuplot's black is the ink of the page: what is drawn in it takes the colour around it.
std::string in_current_colour(std::string svg) {
  for (const char* black : {"black", "rgb(  0,   0,   0)", "rgb(0,0,0)"}) {
    for (const char quote : {'\'', '"'}) {
      replace_all(svg, fmt::format(" color={0}{1}{0}", quote, black), "");
      for (const char* attribute : {"stroke", "fill"}) {
        replace_all(svg, fmt::format("{0}={1}{2}{1}", attribute, quote, black),
                    fmt::format("{0}={1}currentColor{1}", attribute, quote));
      }
    }
  }
  return svg;
}

std::string dots_block(const std::string& name, const std::vector<std::optional<Dot>>& dots) {
  std::string out = "$" + name + " << EOD\n";
  for (std::size_t i = 0; i < dots.size(); ++i) {
    if (!dots[i]) continue;
    out += fmt::format("{} {:.6g} {:.6g} {:.6g}\n", i, dots[i]->value, dots[i]->low, dots[i]->high);
  }
  return out + "EOD\n";
}

bool empty(const Dots& series) {
  return std::ranges::none_of(series.dots, [](const auto& d) { return d.has_value(); });
}

}  // namespace

int dots_height(std::size_t labels) { return kAroundRows + kRowHeight * static_cast<int>(labels); }

std::string dot_panels(const std::vector<std::string>& labels, const std::vector<Panel>& panels) {
  std::string out = fmt::format("set multiplot\nset yrange [{}:-0.6]\n",
                                static_cast<double>(labels.size()) - 0.4);
  // The first panel names the rows, the others have bare tics.
  std::string tics;
  std::string bare;
  for (std::size_t i = 0; i < labels.size(); ++i) {
    tics += fmt::format("{}{} {}", i == 0 ? "" : ", ", records::gnuplot_text(labels[i]), i);
    bare += fmt::format("{}'' {}", i == 0 ? "" : ", ", i);
  }
  const double width = (kRightMargin - kLabelShare) / static_cast<double>(panels.size());
  for (std::size_t p = 0; p < panels.size(); ++p) {
    const Panel& panel = panels[p];
    const double left = kLabelShare + width * static_cast<double>(p) + (p > 0 ? kGap : 0);
    out += fmt::format("set lmargin at screen {:.3f}\nset rmargin at screen {:.3f}\n", left,
                       kLabelShare + width * static_cast<double>(p + 1));
    out += fmt::format("set title {}\n", records::gnuplot_text(panel.title));
    out += fmt::format("set ytics ({})\n", p == 0 ? tics : bare);
    out += panel.logarithmic ? "set logscale x\nset xrange [*:*]\n"
           : panel.zero_line ? "unset logscale\nset xrange [*<0:0<*]\n"
                             : "unset logscale\nset xrange [0:*]\n";
    out += panel.zero_line
               ? "set arrow 1 from 0, graph 0 to 0, graph 1 nohead dt 2 lc rgb 'black'\n"
               : "unset arrow 1\n";
    out += panel.tics > 0 ? fmt::format("set xtics {}\n", panel.tics) : "set xtics autofreq\n";
    std::string plots;
    for (std::size_t s = 0; s < panel.series.size(); ++s) {
      const Dots& series = panel.series[s];
      if (empty(series)) continue;
      const std::string name = fmt::format("p{}s{}", p, s);
      out += dots_block(name, series.dots);
      plots += fmt::format(
          "{}${} using 2:1:3:4 with xerrorbars pt {} ps 1.1 lw 1.6 lc rgb '{}' {}",
          plots.empty() ? "plot " : ", ", name, series.hollow ? 6 : 7, series.colour,
          series.title.empty() ? "notitle" : "title " + records::gnuplot_text(series.title));
    }
    out += "set key below\n" + (plots.empty() ? "plot [0:1] NaN notitle" : plots) + "\n";
  }
  return out + "unset multiplot\n";
}

void draw_figure(const fs::path& folder, const Figure& figure) {
  const auto draw = [&](const std::string& kind) {
    const fs::path file = folder / (figure.name + "." + kind);
    const bool is_svg = kind == "svg";
    const std::string head =
        is_svg
            ? fmt::format("set terminal svg size {},{} noenhanced font 'sans-serif,{}'\n",
                          figure.width, figure.height, figure.is_headline ? kHeadlineFont : kFont)
            : fmt::format(
                  "set terminal pngcairo size {},{} noenhanced font 'sans,10' background "
                  "rgb 'white'\n",
                  figure.width, figure.height);
    std::string picture = records::picture_of(file, head + kStyle + figure.script);
    if (picture.empty()) {
      throw process::Failure(process::kFailed,
                             "a report needs gnuplot; install the package gnuplot-nox");
    }
    if (is_svg) picture = in_current_colour(std::move(picture));
    process::write_whole(file, picture);
  };
  draw("png");
  draw("svg");
}

std::string inline_svg(const fs::path& folder, const Figure& figure) {
  std::string svg = process::read_whole(folder / (figure.name + ".svg"), process::kFailed);
  svg.erase(0, svg.find("<svg"));
  replace_all(svg, "xmlns=\"http://www.w3.org/2000/svg\"", "role=\"img\"");
  replace_all(svg, "xmlns:xlink=\"http://www.w3.org/1999/xlink\"", "");
  replace_all(svg, "xlink:href", "href");
  const std::size_t title = svg.find("<title>");
  const std::size_t end = svg.find("</desc>");
  if (title != std::string::npos && end != std::string::npos) svg.erase(title, end + 7 - title);
  const std::string own = figure.name + "-";
  for (const char* reference : {"id='", "id=\"", "href='#", "href=\"#", "url(#"}) {
    replace_all(svg, reference, std::string(reference) + own);
  }
  return svg;
}

}  // namespace interneuron::report
