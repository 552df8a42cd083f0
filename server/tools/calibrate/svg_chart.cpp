#include "tools/calibrate/svg_chart.hpp"

#include <algorithm>
#include <cmath>

#include "tools/calibrate/svg_parts.hpp"
#include "tools/terminal.hpp"

namespace fiducap {
namespace {

constexpr double kWidth = 560, kHeight = 420;  // of one chart
constexpr double kLeft = 70, kRight = 18, kTop = 44, kBottom = 54;
constexpr const char* kGrid = "#d8dce2";

bool drawable(const std::pair<double, double>& p) {
  return p.first > 0 && p.second > 0 && std::isfinite(p.first) && std::isfinite(p.second);
}

/// Powers of ten from … to.
struct Decades {
  int first{0};
  int last{1};

  [[nodiscard]] double place(double value) const {
    return (std::log10(value) - first) / (last - first);
  }
};

Decades around(const std::vector<double>& values) {
  if (values.empty()) return {};
  const auto [low, high] = std::minmax_element(values.begin(), values.end());
  Decades decades{static_cast<int>(std::floor(std::log10(*low))),
                  static_cast<int>(std::ceil(std::log10(*high)))};
  decades.last = std::max(decades.last, decades.first + 1);
  return decades;
}

class Panel final {
 public:
  Panel(const LogLogChart& chart, double left) : chart_(chart), left_(left + kLeft) {
    std::vector<double> xs;
    std::vector<double> ys;
    for (const ChartSeries& line : chart.series)
      for (const auto& p : line.points)
        if (drawable(p)) {
          xs.push_back(p.first);
          ys.push_back(p.second);
        }
    x_ = around(xs);
    y_ = around(ys);
  }

  [[nodiscard]] std::string draw() const {
    std::string out = svg_text(left_ + inner_width() / 2, 24, "middle", chart_.title, 15);
    out += grid();
    for (const ChartSeries& line : chart_.series) out += path(line);
    out += svg_text(left_ + inner_width() / 2, kHeight - 14, "middle", chart_.x_label, 12);
    const double middle = kTop + inner_height() / 2;
    const std::string at = fixed(left_ - 52, 1) + " " + fixed(middle, 1);
    out += "<g transform=\"rotate(-90 " + at + ")\">" +
           svg_text(left_ - 52, middle, "middle", chart_.y_label, 12) + "</g>\n";
    return out + legend();
  }

 private:
  static double inner_width() { return kWidth - kLeft - kRight; }
  static double inner_height() { return kHeight - kTop - kBottom; }
  [[nodiscard]] double px(double x) const { return left_ + x_.place(x) * inner_width(); }
  [[nodiscard]] double py(double y) const { return kTop + (1 - y_.place(y)) * inner_height(); }

  static std::string power(double x, double y, const char* anchor, int exponent) {
    return "<text x=\"" + fixed(x, 1) + "\" y=\"" + fixed(y, 1) + "\" text-anchor=\"" + anchor +
           "\" font-size=\"11\" fill=\"" + kSvgInk + "\">10<tspan dy=\"-5\" font-size=\"8\">" +
           std::to_string(exponent) + "</tspan></text>\n";
  }

  [[nodiscard]] std::string grid() const {
    std::string out;
    const std::string strong = std::string("stroke=\"") + kGrid + "\"";
    const std::string faint = strong + " stroke-opacity=\"0.45\"";
    const double bottom = kTop + inner_height();
    for (int e = x_.first; e <= x_.last; ++e) {
      const double decade = std::pow(10.0, e);
      out += svg_line(px(decade), kTop, px(decade), bottom, strong) +
             power(px(decade), bottom + 17, "middle", e);
      for (int k = 2; k < 10 && e < x_.last; ++k)
        out += svg_line(px(k * decade), kTop, px(k * decade), bottom, faint);
    }
    for (int e = y_.first; e <= y_.last; ++e) {
      const double decade = std::pow(10.0, e);
      out += svg_line(left_, py(decade), left_ + inner_width(), py(decade), strong) +
             power(left_ - 7, py(decade) + 4, "end", e);
      for (int k = 2; k < 10 && e < y_.last; ++k)
        out += svg_line(left_, py(k * decade), left_ + inner_width(), py(k * decade), faint);
    }
    return out;
  }

  [[nodiscard]] static std::string stroke(const ChartSeries& series) {
    return "fill=\"none\" stroke=\"" + svg_escaped(series.color) + "\" stroke-width=\"" +
           (series.dashed ? "1.3\" stroke-dasharray=\"6 4\"" : "2\"");
  }

  [[nodiscard]] std::string path(const ChartSeries& series) const {
    std::string points;
    for (const auto& p : series.points)
      if (drawable(p)) points += fixed(px(p.first), 1) + "," + fixed(py(p.second), 1) + " ";
    return "<polyline points=\"" + points + "\" " + stroke(series) + "/>\n";
  }

  [[nodiscard]] std::string legend() const {
    const double x = left_ + inner_width() - 190;
    double y = kTop + 16;
    std::string out = "<rect x=\"" + fixed(x - 10, 1) + "\" y=\"" + fixed(kTop + 3, 1) +
                      "\" width=\"196\" height=\"" +
                      fixed(16.0 * static_cast<double>(chart_.series.size()) + 8, 1) +
                      "\" rx=\"4\" fill=\"#fff\" fill-opacity=\"0.85\"/>\n";
    for (const ChartSeries& series : chart_.series) {
      out += svg_line(x, y - 4, x + 24, y - 4, stroke(series)) +
             svg_text(x + 32, y, "start", series.name, 11);
      y += 16;
    }
    return out;
  }

  const LogLogChart& chart_;
  double left_;
  Decades x_;
  Decades y_;
};

}  // namespace

std::string to_svg(const std::vector<LogLogChart>& charts) {
  const double width = kWidth * static_cast<double>(charts.size());
  std::string out = "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 " + fixed(width, 0) +
                    " " + fixed(kHeight, 0) +
                    "\" font-family=\"sans-serif\">\n<rect width=\"100%\" "
                    "height=\"100%\" fill=\"#fff\"/>\n";
  double left = 0;
  for (const LogLogChart& chart : charts) {
    out += Panel(chart, left).draw();
    left += kWidth;
  }
  return out + "</svg>\n";
}

}  // namespace fiducap
