#include "tools/plot/plot_page.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string_view>

#include <nlohmann/json.hpp>

#include "base/numeric.hpp"
#include "base/whole_file.hpp"
#include "streaming/web/content.hpp"

namespace fiducap {
namespace {

/// With numbers of single precision: half the size, and more than a screen can show. Numbers that
/// are not finite become null.
using PlotJson = nlohmann::basic_json<nlohmann::ordered_map, std::vector, std::string, bool,
                                      std::int64_t, std::uint64_t, float>;

constexpr const char* kStyle = R"(
:root { color-scheme: light dark; }
body { font-family: system-ui, sans-serif; line-height: 1.45; color: #222; background: #fff;
  margin: 0 auto; padding: 0.8rem; max-width: 62rem; }
h1 { font-size: 1.35rem; margin: 0.3rem 0 0.8rem; overflow-wrap: anywhere; }
h2 { font-size: 1.05rem; margin: 1.4rem 0 0.4rem; }
.small { font-size: 0.9rem; margin: 0.2rem 0 0.6rem; }
.legend { display: flex; flex-wrap: wrap; gap: 0 1.2rem; font-size: 0.85rem; margin-left: 4rem; }
.legend i { display: inline-block; width: 1.3rem; height: 0.65rem; margin-right: 0.4rem; }
.legend i.line { height: 0; border-top: 2px solid; vertical-align: middle; }
table { border-collapse: collapse; }
.uplot table { width: auto; }
h2 + table th, h2 + table td { text-align: left; vertical-align: top;
  padding: 0.2rem 0.8rem 0.2rem 0; border-bottom: 1px solid #d8dce2; overflow-wrap: anywhere; }
h2 + table th { font-weight: normal; color: #555; }
h2 + table td { font-variant-numeric: tabular-nums; }
@media (prefers-color-scheme: dark) {
  body { color: #ddd; background: #14171b; }
  h2 + table th { color: #aaa; }
  h2 + table th, h2 + table td { border-color: #3a414a; }
}
)";

/// Interval of one axis.
class PlotRange final {
 public:
  explicit PlotRange(bool logarithmic) : logarithmic_(logarithmic) {}

  /// Finite, and positive on a logarithmic axis.
  [[nodiscard]] bool can_show(double value) const {
    return std::isfinite(value) && (!logarithmic_ || value > 0);
  }
  [[nodiscard]] double shown(double value) const { return can_show(value) ? value : kPlotGap; }
  void add(double value) {
    if (!can_show(value)) return;
    low_ = std::min(low_, value);
    high_ = std::max(high_, value);
  }
  /// Widens the interval when it is empty or a single value; a logarithmic one to whole decades.
  /// @param margin  added at both ends of a linear one, relative to its length
  void finish(double margin) {
    if (!(low_ <= high_)) low_ = logarithmic_ ? 1 : 0, high_ = logarithmic_ ? 10 : 1;
    if (logarithmic_) {
      low_ = std::pow(10, std::floor(std::log10(low_)));
      high_ = std::max(10 * low_, std::pow(10, std::ceil(std::log10(high_))));
      return;
    }
    const double least = 1e-6 * std::max(std::abs(low_), std::abs(high_));
    const double half =
        high_ - low_ > least ? margin * (high_ - low_) : std::max(1e-3, 0.05 * std::abs(low_));
    low_ -= low_ == 0 && margin > 0 ? 0 : half;
    high_ += half;
  }
  /// 0 … 1 within the interval; not finite for values that cannot be shown.
  [[nodiscard]] double share(double value) const {
    if (!can_show(value)) return kPlotGap;
    return logarithmic_ ? std::log(value / low_) / std::log(high_ / low_)
                        : (value - low_) / (high_ - low_);
  }
  [[nodiscard]] PlotJson json() const { return {low_, high_}; }

 private:
  bool logarithmic_;
  double low_{std::numeric_limits<double>::infinity()};
  double high_{-std::numeric_limits<double>::infinity()};
};

/// Of lines, columns and shapes.
template <typename Take>
void for_each_point(const PlotPanel& panel, const Take& take) {
  for (const PlotLine& line : panel.lines)
    for (const auto& [x, y] : line.points) take(x, y);
  for (const PlotColumns& columns : panel.columns)
    for (const auto& [from, to, height] : columns.columns) take(from, height), take(to, height);
  for (const PlotShapes& shapes : panel.shapes)
    for (const PlotShapes::Shape& shape : shapes.shapes)
      for (const auto& [x, y] : shape.outline) take(x, y);
}

PlotRange x_range_of(const LinePlot& plot) {
  PlotRange range(plot.logarithmic);
  for (const PlotPanel& panel : plot.panels) {
    for_each_point(panel, [&](double x, double) { range.add(x); });
    for (const PlotArea& area : panel.areas)
      for (const PlotArea::Slice& slice : area.slices) range.add(slice.x);
    for (const PlotBand& band : panel.bands) range.add(band.from), range.add(band.to);
    for (const PlotSpans& spans : panel.spans)
      for (const auto& [from, to] : spans.from_to) range.add(from), range.add(to);
    for (const PlotMarks& marks : panel.marks)
      for (const double at : marks.at) range.add(at);
  }
  range.finish(0);
  return range;
}

/// As far as 95 % of the slices reach.
void add_usual(const std::vector<PlotArea>& areas, PlotRange& range) {
  constexpr double kUsualShare = 0.95;
  std::vector<double> lows;
  std::vector<double> highs;
  for (const PlotArea& area : areas)
    for (const PlotArea::Slice& slice : area.slices) {
      if (!range.can_show(slice.low) || !range.can_show(slice.high)) continue;
      lows.push_back(slice.low);
      highs.push_back(slice.high);
    }
  if (lows.empty()) return;
  range.add(quantile(std::move(lows), 1 - kUsualShare));
  range.add(quantile(std::move(highs), kUsualShare));
}

PlotRange y_range_of(const PlotPanel& panel, double margin) {
  PlotRange range(panel.logarithmic);
  for_each_point(panel, [&](double, double y) { range.add(y); });
  add_usual(panel.areas, range);
  if (panel.goal) range.add(*panel.goal);
  if (panel.from_zero) range.add(0);
  range.finish(margin);
  return range;
}

constexpr std::size_t kFewPoints = 1000;  // are written as they are

/// Column of a value, of 2000 over the axis; not finite values are in no common column.
double column_of(const PlotRange& x, double value) {
  constexpr double kColumns = 2000;
  return std::floor(kColumns * x.share(value));
}

/// Numbers x, y, x, y, …; of consecutive points in one column the first, lowest, highest and last.
PlotJson thinned(const std::vector<PlotPoint>& points, const PlotRange& x, const PlotRange& y) {
  PlotJson out = PlotJson::array();
  const auto column = [&](std::size_t i) {
    return y.can_show(points[i].second) ? column_of(x, points[i].first) : kPlotGap;
  };
  const auto write = [&](std::size_t i) {
    out.push_back(x.shown(points[i].first));
    out.push_back(y.shown(points[i].second));
  };
  for (std::size_t begin = 0, end = 0; begin < points.size(); begin = end) {
    std::array<std::size_t, 4> kept{begin, begin, begin, begin};  // begin, low, high, last
    for (end = begin + 1;
         end < points.size() && points.size() > kFewPoints && column(end) == column(begin); ++end) {
      if (points[end].second < points[kept[1]].second) kept[1] = end;
      if (points[end].second > points[kept[2]].second) kept[2] = end;
      kept[3] = end;
    }
    std::ranges::sort(kept);
    std::for_each(kept.begin(), std::unique(kept.begin(), kept.end()), write);
  }
  return out;
}

/// Numbers x, low, high, …; slices of one column become one.
PlotJson thinned(const std::vector<PlotArea::Slice>& slices, const PlotRange& x,
                 const PlotRange& y) {
  PlotJson out = PlotJson::array();
  for (std::size_t begin = 0, end = 0; begin < slices.size(); begin = end) {
    PlotArea::Slice slice = slices[begin];
    for (end = begin + 1; end < slices.size() && slices.size() > kFewPoints &&
                          column_of(x, slices[end].x) == column_of(x, slice.x);
         ++end) {
      slice.low = std::min(slice.low, slices[end].low);
      slice.high = std::max(slice.high, slices[end].high);
    }
    for (const double value : {x.shown(slice.x), y.shown(slice.low), y.shown(slice.high)})
      out.push_back(value);
  }
  return out;
}

template <typename Range, typename Convert>
PlotJson array_of(const Range& range, Convert convert) {
  PlotJson out = PlotJson::array();
  for (const auto& one : range) out.push_back(convert(one));
  return out;
}

PlotJson flat(const std::vector<PlotPoint>& points) {
  PlotJson out = PlotJson::array();
  for (const auto& [x, y] : points) {
    out.push_back(x);
    out.push_back(y);
  }
  return out;
}

PlotJson flat(const std::vector<PlotColumns::Column>& columns) {
  PlotJson out = PlotJson::array();
  for (const PlotColumns::Column& column : columns)
    for (const double value : {column.from, column.to, column.height}) out.push_back(value);
  return out;
}

PlotJson shape_json(const PlotShapes::Shape& shape) {
  return {{"outline", flat(shape.outline)}, {"label", shape.label}};
}

PlotJson panel_json(const PlotPanel& panel, const PlotRange& x, double margin) {
  const PlotRange y = y_range_of(panel, margin);
  PlotJson json{{"yLabel", panel.y_label}, {"yLog", panel.logarithmic}, {"y", y.json()}};
  json["goal"] = panel.goal ? PlotJson(*panel.goal) : PlotJson(nullptr);
  json["bands"] = array_of(panel.bands, [](const PlotBand& band) -> PlotJson {
    return {{"from", band.from}, {"to", band.to}, {"name", band.name}};
  });
  json["spans"] = array_of(panel.spans, [](const PlotSpans& spans) -> PlotJson {
    return {{"name", spans.name}, {"fromTo", flat(spans.from_to)}};
  });
  json["areas"] = array_of(panel.areas, [&](const PlotArea& area) -> PlotJson {
    return {{"name", area.name}, {"color", area.color}, {"slices", thinned(area.slices, x, y)}};
  });
  json["columns"] = array_of(panel.columns, [](const PlotColumns& columns) -> PlotJson {
    return {{"name", columns.name},
            {"color", columns.color},
            {"filled", columns.filled},
            {"columns", flat(columns.columns)}};
  });
  json["lines"] = array_of(panel.lines, [&](const PlotLine& line) -> PlotJson {
    return {{"name", line.name},   {"color", line.color}, {"dashed", line.dashed},
            {"width", line.width}, {"dots", line.dots},   {"points", thinned(line.points, x, y)}};
  });
  json["marks"] = array_of(panel.marks, [](const PlotMarks& marks) -> PlotJson {
    return {{"name", marks.name}, {"color", marks.color}, {"at", marks.at}};
  });
  json["shapes"] = array_of(panel.shapes, [](const PlotShapes& shapes) -> PlotJson {
    return {{"name", shapes.name},
            {"color", shapes.color},
            {"filled", shapes.filled},
            {"shapes", array_of(shapes.shapes, shape_json)}};
  });
  return json;
}

PlotJson plot_json(const LinePlot& plot) {
  const PlotRange x = x_range_of(plot);
  const double margin = plot.equal_axes ? 0 : 0.04;
  return {{"xLabel", plot.x_label},
          {"xLog", plot.logarithmic},
          {"x", x.json()},
          {"equal", plot.equal_axes},
          {"yDown", plot.y_down},
          {"height", plot.panel_height},
          {"panels", array_of(plot.panels, [&](const PlotPanel& panel) {
             return panel_json(panel, x, margin);
           })}};
}

/// For text of HTML. Control characters become '?'.
std::string escaped(std::string_view text) {
  std::string out;
  for (const char c : text) {
    if (c == '&')
      out += "&amp;";
    else if (c == '<')
      out += "&lt;";
    else if (c == '>')
      out += "&gt;";
    else
      out += static_cast<unsigned char>(c) < 0x20 && c != '\n' && c != '\t' ? '?' : c;
  }
  return out;
}

/// JSON that may be inside of a script element.
std::string embedded(const PlotJson& json) {
  std::string out;
  for (const char c : json.dump(-1, ' ', false, PlotJson::error_handler_t::replace))
    c == '<' ? out += "\\u003c" : out += c;
  return out;
}

}  // namespace

Expected<std::string> plot_script() {
  return read_whole_file((web::page_root("") / "plots.js").string());
}

std::string to_html(const PlotPage& page, const Expected<std::string>& script) {
  std::string out =
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n<title>" +
      escaped(page.title) + "</title>\n<style>" + kStyle + "</style>\n</head>\n<body>\n<h1>" +
      escaped(page.title) + "</h1>\n";
  for (const std::string& remark : page.remarks) out += "<p>" + escaped(remark) + "</p>\n";
  if (!script)
    out += "<p>The plots are not drawn: " + escaped(script.error().text()) +
           ". The web page is not installed beside fiducap (FIDUCAP_WEB).</p>\n";
  for (const LinePlot& plot : page.plots) {
    out += "<h2>" + escaped(plot.title) + "</h2>\n";
    if (!plot.subtitle.empty()) out += "<p class=\"small\">" + escaped(plot.subtitle) + "</p>\n";
    out += "<div class=\"plot\"></div>\n";
  }
  for (const PlotTable& table : page.tables) {
    out += "<h2>" + escaped(table.title) + "</h2>\n<table>\n";
    for (const auto& [name, value] : table.rows)
      out += "<tr><th>" + escaped(name) + "</th><td>" + escaped(value) + "</td></tr>\n";
    out += "</table>\n";
  }
  if (script)
    out += "<script type=\"application/json\" id=\"plots\">" +
           embedded(array_of(page.plots, plot_json)) + "</script>\n<script>" + *script +
           "</script>\n";
  return out + "</body>\n</html>\n";
}

}  // namespace fiducap
