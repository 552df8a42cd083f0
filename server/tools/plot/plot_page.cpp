#include "tools/plot/plot_page.hpp"

#include "base/text.hpp"

namespace fiducap {
namespace {

// Colours of the pictures are attributes, which any rule here overrules.
constexpr const char* kStyle = R"(
:root { color-scheme: light dark; }
body { font-family: system-ui, sans-serif; line-height: 1.45; color: #222; background: #fff;
  margin: 0 auto; padding: 0.8rem; max-width: 62rem; }
h1 { font-size: 1.35rem; margin: 0.3rem 0 0.8rem; overflow-wrap: anywhere; }
h2 { font-size: 1.05rem; margin: 1.4rem 0 0.4rem; }
.small { font-size: 0.9rem; margin: 0.2rem 0 0.6rem; }
.picture { overflow-x: auto; margin: 0 0 1rem; }
.picture svg { display: block; width: 100%; min-width: 34rem; height: auto; }
table { border-collapse: collapse; }
th, td { text-align: left; vertical-align: top; padding: 0.2rem 0.8rem 0.2rem 0;
  border-bottom: 1px solid #d8dce2; overflow-wrap: anywhere; }
th { font-weight: normal; color: #555; }
td { font-variant-numeric: tabular-nums; }
@media (prefers-color-scheme: dark) {
  body { color: #ddd; background: #14171b; }
  th { color: #aaa; }
  th, td { border-color: #3a414a; }
  svg [fill="#333"] { fill: #ddd; }
  svg [fill="#fff"] { fill: #14171b; }
  svg [fill="#fff3c4"] { fill: #4a4218; }
  svg [stroke="#d8dce2"] { stroke: #3a414a; }
  svg [stroke="#fff"] { stroke: #14171b; }
  svg [stroke="#333"] { stroke: #ddd; }
  svg [stroke="#777"] { stroke: #aaa; }
  svg [fill="#777"] { fill: #aaa; }
  svg [stroke="#0072b2"] { stroke: #4fb0ee; }
  svg [fill="#0072b2"] { fill: #4fb0ee; }
  svg [stroke="#d55e00"] { stroke: #ff8a3c; }
  svg [fill="#d55e00"] { fill: #ff8a3c; }
}
)";

/// What is written above a plot wraps where the page does.
std::string section_of(LinePlot plot) {
  std::string out = "<h2>" + svg_escaped(plot.title) + "</h2>\n";
  if (!plot.subtitle.empty()) out += "<p class=\"small\">" + svg_escaped(plot.subtitle) + "</p>\n";
  plot.title.clear();
  plot.subtitle.clear();
  return out + "<div class=\"picture\">" + svg_document(draw(plot)) + "</div>\n";
}

}  // namespace

std::string to_html(const PlotPage& page) {
  std::string out =
      "<!DOCTYPE html>\n<html xmlns=\"http://www.w3.org/1999/xhtml\" lang=\"en\">\n<head>\n"
      "<meta charset=\"utf-8\"/>\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n<title>" +
      svg_escaped(page.title) + "</title>\n<style>" + kStyle + "</style>\n</head>\n<body>\n<h1>" +
      svg_escaped(page.title) + "</h1>\n";
  for (const std::string& remark : page.remarks) out += "<p>" + svg_escaped(remark) + "</p>\n";
  for (const LinePlot& plot : page.plots) out += section_of(plot);
  for (const PlotTable& table : page.tables) {
    out += "<h2>" + svg_escaped(table.title) + "</h2>\n<table>\n";
    for (const auto& [name, value] : table.rows)
      out += "<tr><th>" + svg_escaped(name) + "</th><td>" + svg_escaped(value) + "</td></tr>\n";
    out += "</table>\n";
  }
  return out + "</body>\n</html>\n";
}

std::string to_svg(const PlotPage& page) {
  std::vector<SvgPicture> pictures;
  for (const LinePlot& plot : page.plots) pictures.push_back(draw(plot));
  return svg_document(svg_stacked(pictures));
}

}  // namespace fiducap
