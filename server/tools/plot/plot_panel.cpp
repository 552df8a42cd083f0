#include "tools/plot/plot_panel.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/quantile.hpp"
#include "base/text.hpp"
#include "tools/plot/thinning.hpp"

namespace fiducap {
namespace {

constexpr const char* kBandFill = "#fff3c4";
constexpr const char* kGoalColor = "#2e7d32";
constexpr double kLeastWidth_px = 0.8;  // of a shaded part: a short one must not vanish
constexpr double kLeastShape_px = 4;
constexpr double kUsualShare = 0.95;  // of an area's slices: the others may be cut off
constexpr int kTickText = 13, kLabelText = 14, kSmallText = 12;
constexpr double kRow = 19;     // of the legend
constexpr double kSample = 24;  // what stands before a name
constexpr std::size_t kMostLabels = 1500;
// Readable on top of lines.
constexpr const char* kHalo =
    "stroke=\"#fff\" stroke-width=\"3\" stroke-linejoin=\"round\" paint-order=\"stroke\"";

std::string stroke(const PlotLine& line) {
  return "fill=\"none\" stroke=\"" + svg_escaped(line.color) + "\" stroke-width=\"" +
         fixed(line.width, 1) + "\" stroke-linejoin=\"round\"" +
         (line.dashed ? " stroke-dasharray=\"6 4\"" : "");
}

std::string area_fill(const std::string& color) {
  return "fill=\"" + svg_escaped(color) + "\" fill-opacity=\"0.2\"";
}

std::string box_style(const std::string& color, bool filled) {
  return "fill=\"" + (filled ? svg_escaped(color) : "none") + "\"" +
         (filled ? " fill-opacity=\"0.45\"" : "") + " stroke=\"" + svg_escaped(color) + "\"";
}

std::string span_fill() { return std::string("fill=\"") + kSvgBorder + "\" fill-opacity=\"0.28\""; }

std::string mark_stroke(const std::string& color) {
  return "stroke=\"" + svg_escaped(color) + "\" stroke-width=\"1.2\" stroke-dasharray=\"3 2\"";
}

PlotLine goal_line(double goal, double from, double to) {
  return {"goal", kGoalColor, {{from, goal}, {to, goal}}, true, 1.4};
}

/// As far as most of its slices reach.
void add_usual(const std::vector<PlotArea>& areas, PlotAxis& axis) {
  std::vector<double> lows;
  std::vector<double> highs;
  for (const PlotArea& area : areas)
    for (const PlotArea::Slice& slice : area.slices) {
      if (axis.can_show(slice.low)) lows.push_back(slice.low);
      if (axis.can_show(slice.high)) highs.push_back(slice.high);
    }
  if (lows.empty() || highs.empty()) return;
  axis.add(quantile(std::move(lows), 1 - kUsualShare));
  axis.add(quantile(std::move(highs), kUsualShare));
}

/// A word that has its place on the sheet.
struct Label {
  double left{}, right{}, top{}, bottom{};

  [[nodiscard]] bool meets(const Label& other) const {
    return left < other.right && other.left < right && top < other.bottom && other.top < bottom;
  }
};

}  // namespace

PlotAxis y_axis_of(const PlotPanel& panel, PlotAxis::Ends ends) {
  PlotAxis axis(panel.logarithmic ? PlotAxis::Scale::kLogarithmic : PlotAxis::Scale::kLinear);
  for (const PlotLine& line : panel.lines)
    for (const PlotPoint& p : line.points) axis.add(p.second);
  for (const PlotColumns& columns : panel.columns)
    for (const PlotColumns::Column& column : columns.columns) axis.add(column.height);
  for (const PlotShapes& shapes : panel.shapes)
    for (const PlotShapes::Shape& shape : shapes.shapes)
      for (const PlotPoint& p : shape.outline) axis.add(p.second);
  add_usual(panel.areas, axis);
  if (panel.goal) axis.add(*panel.goal);
  if (panel.from_zero) axis.add(0);
  axis.finish(5, ends);
  return axis;
}

double PanelDrawing::clamped_py(double y) const {
  return std::clamp(y_.can_show(y) ? py(y) : bottom(), place_.top, bottom());
}

std::string PanelDrawing::draw(bool has_x_labels) const {
  std::string out = shaded() + grid(has_x_labels);
  for (const PlotArea& one : panel_.areas) out += area(one);
  for (const PlotColumns& one : panel_.columns) out += columns(one);
  for (const PlotLine& one : panel_.lines) out += path(one);
  if (panel_.goal) out += path(goal_line(*panel_.goal, x_.low(), x_.high()));
  for (const PlotMarks& one : panel_.marks) out += marks(one);
  for (const PlotShapes& one : panel_.shapes) out += outlines(one);
  out += labels();
  const double middle = place_.top + place_.height / 2;
  out += svg_text(18, middle, "middle", panel_.y_label, kLabelText,
                  "transform=\"rotate(-90 18 " + fixed(middle, 1) + ")\"");
  return out;
}

std::string PanelDrawing::shaded() const {
  std::string out;
  const auto box = [&](double from, double to, const std::string& fill) {
    const double width = std::max(kLeastWidth_px, px(to) - px(from));
    out += svg_box(px(from), place_.top, width, place_.height, fill);
  };
  for (const PlotBand& band : panel_.bands) {
    box(band.from, band.to, std::string("fill=\"") + kBandFill + "\"");
    const bool fits = px(band.to) - px(band.from) > svg_text_width(band.name, kSmallText);
    if (band.name.empty()) continue;
    out += svg_text(fits ? (px(band.from) + px(band.to)) / 2 : px(band.from) + 3, place_.top + 14,
                    fits ? "middle" : "start", band.name, kSmallText);
  }
  for (const PlotSpans& spans : panel_.spans) {
    // Those that share a pixel are one.
    std::vector<PlotPoint> wide;
    for (const PlotPoint& one : spans.from_to) {
      if (!wide.empty() && px(one.first) - px(wide.back().second) < kLeastWidth_px)
        wide.back().second = std::max(wide.back().second, one.second);
      else
        wide.push_back(one);
    }
    for (const PlotPoint& one : wide) box(one.first, one.second, span_fill());
  }
  return out;
}

std::string PanelDrawing::grid(bool has_x_labels) const {
  std::string out;
  const std::string strong = std::string("stroke=\"") + kSvgGrid + "\"";
  const std::string faint = strong + " stroke-opacity=\"0.45\"";
  for (const PlotTick& tick : x_.ticks()) {
    const double x = px(tick.value);
    out += svg_line(x, place_.top, x, bottom(), tick.text.empty() ? faint : strong);
    if (has_x_labels && !tick.text.empty())
      out += svg_text(x, bottom() + 18, "middle", tick.text, kTickText);
  }
  for (const PlotTick& tick : y_.ticks()) {
    const double y = py(tick.value);
    out +=
        svg_line(place_.left, y, place_.left + place_.width, y, tick.text.empty() ? faint : strong);
    if (!tick.text.empty()) out += svg_text(place_.left - 7, y + 4.5, "end", tick.text, kTickText);
  }
  return out + svg_box(place_.left, place_.top, place_.width, place_.height,
                       std::string("fill=\"none\" stroke=\"") + kSvgBorder + "\"");
}

std::string PanelDrawing::area(const PlotArea& area) const {
  std::string out;
  std::vector<SvgSlice> piece;
  const auto flush = [&] {
    std::vector<SvgPoint> border;
    const std::vector<SvgSlice> slices = thinned(piece);
    for (const SvgSlice& slice : slices) border.emplace_back(slice.x, slice.top);
    for (auto slice = slices.rbegin(); slice != slices.rend(); ++slice)
      border.emplace_back(slice->x, slice->bottom);
    if (slices.size() > 1) out += svg_polygon(border, area_fill(area.color));
    piece.clear();
  };
  for (const PlotArea::Slice& slice : area.slices) {
    if (x_.can_show(slice.x) && std::isfinite(slice.low) && std::isfinite(slice.high))
      piece.push_back({px(slice.x), clamped_py(slice.high), clamped_py(slice.low)});
    else
      flush();
  }
  flush();
  return out;
}

std::string PanelDrawing::columns(const PlotColumns& columns) const {
  std::string out;
  for (const PlotColumns::Column& column : columns.columns) {
    if (!x_.can_show(column.from) || !x_.can_show(column.to) || !(column.height > 0)) continue;
    const double top = clamped_py(column.height);
    out += svg_box(px(column.from), top, px(column.to) - px(column.from), bottom() - top,
                   box_style(columns.color, columns.filled));
  }
  return out;
}

std::string PanelDrawing::path(const PlotLine& line) const {
  std::string out;
  std::vector<SvgPoint> piece;
  const auto flush = [&] {
    if (piece.size() > 1) out += svg_polyline(thinned(piece), stroke(line));
    // What stands alone is there, too.
    if (piece.size() == 1)
      out += "<circle cx=\"" + fixed(piece[0].first, 1) + "\" cy=\"" + fixed(piece[0].second, 1) +
             "\" r=\"1.2\" fill=\"" + svg_escaped(line.color) + "\"/>\n";
    piece.clear();
  };
  for (const PlotPoint& p : line.points) {
    if (can_show(p))
      piece.emplace_back(px(p.first), py(p.second));
    else
      flush();
  }
  flush();
  return out;
}

std::string PanelDrawing::marks(const PlotMarks& marks) const {
  std::string out;
  double last = -1;
  for (const double at : marks.at) {
    if (!x_.can_show(at) || std::abs(px(at) - last) < 1) continue;
    last = px(at);
    out += svg_line(last, place_.top, last, bottom(), mark_stroke(marks.color));
  }
  return out;
}

std::string PanelDrawing::outlines(const PlotShapes& shapes) const {
  std::string out;
  for (const PlotShapes::Shape& shape : shapes.shapes) {
    std::vector<SvgPoint> border;
    double widest = 0;
    for (const PlotPoint& p : shape.outline) {
      if (!can_show(p)) continue;
      border.emplace_back(px(p.first), py(p.second));
      widest = std::max(widest, std::hypot(border.back().first - border.front().first,
                                           border.back().second - border.front().second));
    }
    if (border.empty()) continue;
    if (widest >= kLeastShape_px)
      out += svg_polygon(border, box_style(shapes.color, shapes.filled) + " stroke-width=\"1.6\"");
    else
      out += svg_box(border[0].first - kLeastShape_px / 2, border[0].second - kLeastShape_px / 2,
                     kLeastShape_px, kLeastShape_px, box_style(shapes.color, shapes.filled));
  }
  return out;
}

std::string PanelDrawing::labels() const {
  std::string out;
  std::vector<Label> taken;
  for (const PlotShapes& shapes : panel_.shapes)
    for (const PlotShapes::Shape& shape : shapes.shapes) {
      if (shape.label.empty() || shape.outline.empty() || taken.size() > kMostLabels) continue;
      double right = place_.left;
      double y = 0;
      for (const PlotPoint& p : shape.outline) {
        if (!can_show(p)) return out;
        right = std::max(right, px(p.first));
        y += py(p.second) / static_cast<double>(shape.outline.size());
      }
      const Label label{right + 3, right + 3 + svg_text_width(shape.label, kSmallText), y - 5,
                        y + 6};
      if (label.right > place_.left + place_.width ||
          std::any_of(taken.begin(), taken.end(), [&](const Label& l) { return l.meets(label); }))
        continue;
      taken.push_back(label);
      out += svg_text(label.left, label.bottom - 1.5, "start", shape.label, kSmallText, kHalo);
    }
  return out;
}

PlotLegend::PlotLegend(const PlotPanel& panel, double width) : width_(width) {
  for (const PlotLine& line : panel.lines) add({Entry::Kind::kLine, line.name, stroke(line)});
  for (const PlotArea& area : panel.areas)
    add({Entry::Kind::kBox, area.name, area_fill(area.color)});
  for (const PlotColumns& columns : panel.columns)
    add({Entry::Kind::kBox, columns.name, box_style(columns.color, columns.filled)});
  for (const PlotShapes& shapes : panel.shapes)
    if (!shapes.shapes.empty())
      add({Entry::Kind::kBox, shapes.name, box_style(shapes.color, shapes.filled)});
  for (const PlotMarks& marks : panel.marks)
    if (!marks.at.empty()) add({Entry::Kind::kStroke, marks.name, mark_stroke(marks.color)});
  for (const PlotSpans& spans : panel.spans)
    if (!spans.from_to.empty()) add({Entry::Kind::kBox, spans.name, span_fill()});
  if (panel.goal) add({Entry::Kind::kLine, "goal", stroke(goal_line(*panel.goal, 0, 0))});
}

void PlotLegend::add(const Entry& entry) {
  if (entry.name.empty()) return;
  const double needed = kSample + 24 + svg_text_width(entry.name, kTickText);
  if (rows_.empty() || used_ + needed > width_) {
    rows_.emplace_back();
    used_ = 0;
  }
  used_ += needed;
  rows_.back().push_back(entry);
}

double PlotLegend::height() const { return kRow * static_cast<double>(rows_.size()); }

std::string PlotLegend::draw(double left, double top) const {
  std::string out;
  double y = top + kRow / 2;
  for (const auto& row : rows_) {
    double x = left;
    for (const Entry& entry : row) {
      if (entry.kind == Entry::Kind::kLine) out += svg_line(x, y, x + kSample, y, entry.style);
      if (entry.kind == Entry::Kind::kBox) out += svg_box(x + 4, y - 6, 16, 11, entry.style);
      if (entry.kind == Entry::Kind::kStroke)
        out += svg_line(x + kSample / 2, y - 7, x + kSample / 2, y + 7, entry.style);
      out += svg_text(x + kSample + 6, y + 4.5, "start", entry.name, kTickText);
      x += kSample + 24 + svg_text_width(entry.name, kTickText);
    }
    y += kRow;
  }
  return out;
}

}  // namespace fiducap
