#include "paper/line_plot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace fiducap::bench {

namespace {

constexpr double kWidth = 900, kLeft = 78, kRight = 170, kTop = 46, kBottom = 50;
constexpr double kPanel = 190, kBetween = 20;  // heights
constexpr double kAcross = kWidth - kLeft - kRight;
constexpr const char* kInk = "#333333";

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '&') {
      out += "&amp;";
    } else if (c == '<') {
      out += "&lt;";
    } else {
      out += c;
    }
  }
  return out;
}

std::string text(double x, double y, const char* anchor, const std::string& what, int size,
                 const std::string& more = {}) {
  return fmt::format(
      "<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\" font-size=\"{}\" fill=\"{}\" "
      "{}>{}</text>\n",
      x, y, anchor, size, kInk, more, escaped(what));
}

std::string straight(double x1, double y1, double x2, double y2, const std::string& style) {
  return fmt::format("<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" {}/>\n", x1, y1,
                     x2, y2, style);
}

/// What one axis shows, and at which numbers it is labelled.
struct Range {
  double low{std::numeric_limits<double>::infinity()};
  double high{-std::numeric_limits<double>::infinity()};
  double step{1};

  void add(double value) {
    if (!std::isfinite(value)) return;
    low = std::min(low, value);
    high = std::max(high, value);
  }
  [[nodiscard]] double share(double value) const { return (value - low) / (high - low); }
};

/// Steps of 1, 2 or 5 times a power of ten, about `ticks` of them.
double step_for(double span, int ticks) {
  const double rough = span / ticks;
  const double decade = std::pow(10, std::floor(std::log10(rough)));
  for (const double k : {1.0, 2.0, 5.0}) {
    if (k * decade >= rough) return k * decade;
  }
  return 10 * decade;
}

void finish(Range& range, int ticks, bool round) {
  if (!(range.low <= range.high)) range = {0, 1, 1};
  if (range.high - range.low < 1e-12) {
    const double half = std::max(1e-3, 0.05 * std::abs(range.low));
    range.low -= half;
    range.high += half;
  }
  range.step = step_for(range.high - range.low, ticks);
  if (!round) return;
  range.low = range.step * std::floor(range.low / range.step + 1e-9);
  range.high = range.step * std::ceil(range.high / range.step - 1e-9);
}

std::string number(double value, double step) {
  const int decimals = std::max(0, -static_cast<int>(std::floor(std::log10(step) + 1e-9)));
  // No "-0".
  return fmt::format("{:.{}f}", std::abs(value) < 1e-9 * step ? 0.0 : value, decimals);
}

/// Keeps the first, lowest, highest and last point of every pixel column.
std::vector<PlotPoint> thinned(const std::vector<PlotPoint>& points) {
  if (points.size() < 2 * static_cast<std::size_t>(kAcross)) return points;
  std::vector<PlotPoint> out;
  std::size_t begin = 0;
  while (begin < points.size()) {
    const double column = std::floor(points[begin].first);
    std::size_t end = begin;
    std::size_t low = begin;
    std::size_t high = begin;
    while (end < points.size() && std::floor(points[end].first) == column) {
      if (points[end].second < points[low].second) low = end;
      if (points[end].second > points[high].second) high = end;
      ++end;
    }
    end = std::max(end, begin + 1);
    std::vector<std::size_t> kept{begin, low, high, end - 1};
    std::sort(kept.begin(), kept.end());
    kept.erase(std::unique(kept.begin(), kept.end()), kept.end());
    for (const std::size_t i : kept) out.push_back(points[i]);
    begin = end;
  }
  return out;
}

/// Leaves out what changes the line by less than a quarter of a pixel (Ramer, Douglas, Peucker).
std::vector<PlotPoint> simplified(const std::vector<PlotPoint>& points) {
  constexpr double kTolerance_px = 0.25;
  std::vector<bool> kept(points.size(), false);
  kept.front() = kept.back() = true;
  std::vector<std::pair<std::size_t, std::size_t>> open{{0, points.size() - 1}};
  while (!open.empty()) {
    const auto [first, last] = open.back();
    open.pop_back();
    const auto [ax, ay] = points[first];
    const double dx = points[last].first - ax;
    const double dy = points[last].second - ay;
    const double length = std::hypot(dx, dy);
    double most = kTolerance_px;
    std::size_t split = first;
    for (std::size_t i = first + 1; i < last; ++i) {
      const double px = points[i].first - ax;
      const double py = points[i].second - ay;
      // A line that comes back to its start has no direction.
      const double off = length > 0 ? std::abs(px * dy - py * dx) / length : std::hypot(px, py);
      if (off <= most) continue;
      most = off;
      split = i;
    }
    if (split == first) continue;
    kept[split] = true;
    open.emplace_back(first, split);
    open.emplace_back(split, last);
  }
  std::vector<PlotPoint> out;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (kept[i]) out.push_back(points[i]);
  }
  return out;
}

std::string stroke(const PlotLine& line) {
  return fmt::format("fill=\"none\" stroke=\"{}\" stroke-width=\"{}\"{}", line.color, line.width,
                     line.dashed ? " stroke-dasharray=\"6 4\"" : "");
}

class Drawing final {
 public:
  explicit Drawing(const LinePlot& plot) : plot_(plot) {
    for (const PlotPanel& panel : plot.panels) {
      for (const PlotLine& line : panel.lines) {
        for (const PlotPoint& p : line.points) x_.add(p.first);
      }
    }
    finish(x_, 10, false);
    panel_height_ = plot.panels.size() == 1 ? 1.6 * kPanel : kPanel;
    if (!plot.equal_axes) return;
    Range y = range_of(plot.panels.front());
    panel_height_ = std::clamp(kAcross * (y.high - y.low) / (x_.high - x_.low), 120.0, 620.0);
    // Whatever does not fit the panel's shape widens the x axis.
    const double span = (y.high - y.low) * kAcross / panel_height_;
    const double middle = 0.5 * (x_.low + x_.high);
    x_ = {middle - 0.5 * span, middle + 0.5 * span, step_for(span, 10)};
  }

  [[nodiscard]] std::string draw() const {
    const auto count = static_cast<double>(plot_.panels.size());
    const double height = kTop + count * panel_height_ + (count - 1) * kBetween + kBottom;
    std::string out = fmt::format(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {:.0f} {:.0f}\" width=\"{:.0f}\" "
        "height=\"{:.0f}\" font-family=\"sans-serif\">\n<rect width=\"100%\" height=\"100%\" "
        "fill=\"#ffffff\"/>\n",
        kWidth, height, kWidth, height);
    out += text(kLeft, 26, "start", plot_.title, 16);
    double top = kTop;
    for (const PlotPanel& panel : plot_.panels) {
      out += draw(panel, top, &panel == &plot_.panels.back());
      top += panel_height_ + kBetween;
    }
    return out + text(kLeft + kAcross / 2, height - 12, "middle", plot_.x_label, 13) + "</svg>\n";
  }

 private:
  [[nodiscard]] Range range_of(const PlotPanel& panel) const {
    Range y;
    for (const PlotLine& line : panel.lines) {
      for (const PlotPoint& p : line.points) y.add(p.second);
    }
    if (panel.goal) y.add(*panel.goal);
    if (panel.from_zero) y.add(0);
    finish(y, 5, true);
    return y;
  }

  [[nodiscard]] double px(double x) const { return kLeft + x_.share(x) * kAcross; }

  [[nodiscard]] std::string draw(const PlotPanel& panel, double top, bool last) const {
    const Range y = range_of(panel);
    const double bottom = top + panel_height_;
    const auto py = [&](double value) { return bottom - y.share(value) * panel_height_; };
    std::string out;
    for (const PlotBand& band : panel.bands) {
      out += fmt::format(
          "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"#fff3c4\"/>\n",
          px(band.from), top, px(band.to) - px(band.from), panel_height_);
      out += text(0.5 * (px(band.from) + px(band.to)), top + 14, "middle", band.name, 11);
    }
    out += grid(y, top, bottom, last, py);
    for (const PlotLine& line : panel.lines) out += path(line, py);
    if (panel.goal) out += path(goal_line(panel), py);
    const double middle = 0.5 * (top + bottom);
    out += text(22, middle, "middle", panel.y_label, 13,
                fmt::format("transform=\"rotate(-90 22 {:.1f})\"", middle));
    return out + legend(panel, top);
  }

  template <typename Place>
  [[nodiscard]] std::string grid(const Range& y, double top, double bottom, bool last,
                                 const Place& py) const {
    const std::string faint = "stroke=\"#dde1e7\"";
    std::string out;
    for (double x = x_.step * std::ceil(x_.low / x_.step - 1e-9); x <= x_.high + 1e-9 * x_.step;
         x += x_.step) {
      out += straight(px(x), top, px(x), bottom, faint);
      if (last) out += text(px(x), bottom + 17, "middle", number(x, x_.step), 12);
    }
    for (double v = y.low; v <= y.high + 1e-9 * y.step; v += y.step) {
      out += straight(kLeft, py(v), kLeft + kAcross, py(v), faint);
      out += text(kLeft - 7, py(v) + 4, "end", number(v, y.step), 12);
    }
    return out + fmt::format(
                     "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" "
                     "fill=\"none\" stroke=\"#8a93a0\"/>\n",
                     kLeft, top, kAcross, bottom - top);
  }

  [[nodiscard]] PlotLine goal_line(const PlotPanel& panel) const {
    return {"goal", "#2e7d32", {{x_.low, *panel.goal}, {x_.high, *panel.goal}}, true, 1.4};
  }

  template <typename Place>
  [[nodiscard]] std::string path(const PlotLine& line, const Place& py) const {
    std::string out;
    std::vector<PlotPoint> piece;
    const auto flush = [&] {
      if (piece.size() > 1) {
        out += "<polyline points=\"";
        for (const PlotPoint& p : simplified(thinned(piece)))
          out += fmt::format("{:.1f},{:.1f} ", p.first, p.second);
        out += "\" " + stroke(line) + "/>\n";
      }
      piece.clear();
    };
    for (const PlotPoint& p : line.points) {
      if (std::isfinite(p.first) && std::isfinite(p.second)) {
        piece.emplace_back(px(p.first), py(p.second));
      } else {
        flush();
      }
    }
    flush();
    return out;
  }

  [[nodiscard]] std::string legend(const PlotPanel& panel, double top) const {
    const double x = kLeft + kAcross + 12;
    double y = top + 14;
    std::string out;
    const auto entry = [&](const PlotLine& line) {
      if (line.name.empty()) return;
      out += straight(x, y - 4, x + 22, y - 4, stroke(line));
      out += text(x + 28, y, "start", line.name, 12);
      y += 17;
    };
    for (const PlotLine& line : panel.lines) entry(line);
    if (panel.goal) entry(goal_line(panel));
    return out;
  }

  const LinePlot& plot_;
  Range x_;
  double panel_height_{kPanel};
};

}  // namespace

std::string to_svg(const LinePlot& plot) { return Drawing(plot).draw(); }

}  // namespace fiducap::bench
