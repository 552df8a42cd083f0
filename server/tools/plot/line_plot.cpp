#include "tools/plot/line_plot.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "tools/plot/plot_panel.hpp"

namespace fiducap {
namespace {

constexpr double kWidth = 760, kLeft = 76, kRight = 20, kTop = 7, kBottom = 50;
constexpr double kPanel = 190, kBetween = 14;  // heights
constexpr double kAcross = kWidth - kLeft - kRight;
constexpr double kLowest = 120, kHighest = 620;  // of a panel with equal axes
constexpr int kTitleText = 17, kSubtitleText = 13, kAxisText = 14;
constexpr double kTitleRow = 22, kSubtitleRow = 18;
constexpr double kBold = 1.1;  // so much wider are bold letters

PlotAxis x_axis_of(const LinePlot& plot) {
  PlotAxis axis(plot.logarithmic ? PlotAxis::Scale::kLogarithmic : PlotAxis::Scale::kLinear);
  for (const PlotPanel& panel : plot.panels) {
    for (const PlotLine& line : panel.lines)
      for (const PlotPoint& p : line.points) axis.add(p.first);
    for (const PlotArea& area : panel.areas)
      for (const PlotArea::Slice& slice : area.slices) axis.add(slice.x);
    for (const PlotColumns& columns : panel.columns)
      for (const PlotColumns::Column& column : columns.columns) {
        axis.add(column.from);
        axis.add(column.to);
      }
    for (const PlotBand& band : panel.bands) {
      axis.add(band.from);
      axis.add(band.to);
    }
    for (const PlotSpans& spans : panel.spans)
      for (const PlotPoint& one : spans.from_to) {
        axis.add(one.first);
        axis.add(one.second);
      }
    for (const PlotMarks& marks : panel.marks)
      for (const double at : marks.at) axis.add(at);
    for (const PlotShapes& shapes : panel.shapes)
      for (const PlotShapes::Shape& shape : shapes.shapes)
        for (const PlotPoint& p : shape.outline) axis.add(p.first);
  }
  axis.finish(10, PlotAxis::Ends::kAsGiven);
  return axis;
}

/// In lines that fit.
std::vector<std::string> wrapped(const std::string& text, int size, double across) {
  std::vector<std::string> lines;
  std::istringstream words(text);
  for (std::string word; words >> word;) {
    if (lines.empty() || svg_text_width(lines.back() + " " + word, size) > across)
      lines.push_back(word);
    else
      lines.back() += " " + word;
  }
  return lines;
}

/// Where things are on the sheet.
class Sheet final {
 public:
  explicit Sheet(const LinePlot& plot) : plot_(plot), x_(x_axis_of(plot)) {
    panel_height_ = plot.panel_height > 0     ? plot.panel_height
                    : plot.panels.size() == 1 ? 1.6 * kPanel
                                              : kPanel;
    for (const PlotPanel& panel : plot.panels)
      y_.push_back(
          y_axis_of(panel, plot.equal_axes ? PlotAxis::Ends::kAsGiven : PlotAxis::Ends::kRound));
    if (plot.equal_axes && !y_.empty()) make_equal();
  }

  [[nodiscard]] SvgPicture draw() const {
    SvgPicture picture{kWidth, kTop, {}};
    for (const std::string& line : wrapped(plot_.title, kTitleText, kAcross / kBold)) {
      picture.height += kTitleRow;
      picture.body +=
          svg_text(kLeft, picture.height - 5, "start", line, kTitleText, "font-weight=\"bold\"");
    }
    for (const std::string& line : wrapped(plot_.subtitle, kSubtitleText, kAcross)) {
      picture.height += kSubtitleRow;
      picture.body += svg_text(kLeft, picture.height - 3, "start", line, kSubtitleText);
    }
    picture.height += kTop;
    for (std::size_t i = 0; i < plot_.panels.size(); ++i) {
      const PlotPanel& panel = plot_.panels[i];
      const PlotLegend legend(panel, kAcross);
      if (i > 0) picture.height += kBetween;
      picture.body += legend.draw(kLeft, picture.height);
      picture.height += legend.height() + 4;
      picture.body +=
          PanelDrawing(panel, x_, y_[i], {kLeft, picture.height, kAcross, panel_height_})
              .draw(i + 1 == plot_.panels.size());
      picture.height += panel_height_;
    }
    picture.height += kBottom;
    picture.body +=
        svg_text(kLeft + kAcross / 2, picture.height - 12, "middle", plot_.x_label, kAxisText);
    return picture;
  }

 private:
  /// Whatever does not fit the panel's shape widens one of the axes.
  void make_equal() {
    PlotAxis& y = y_.front();
    constexpr double kMargin = 1.08;
    double across = kMargin * (x_.high() - x_.low());
    double up = kMargin * (y.high() - y.low());
    panel_height_ = std::clamp(kAcross * up / across, kLowest, kHighest);
    up = std::max(up, across * panel_height_ / kAcross);
    across = up * kAcross / panel_height_;
    const double x_middle = (x_.low() + x_.high()) / 2;
    const double y_middle = (y.low() + y.high()) / 2;
    x_.span(x_middle - across / 2, x_middle + across / 2, 10);
    // The same steps both ways, so that squares are squares.
    y.span(y_middle - up / 2, y_middle + up / 2,
           std::max(2, static_cast<int>(std::lround(10 * panel_height_ / kAcross))));
  }

  const LinePlot& plot_;
  PlotAxis x_;
  std::vector<PlotAxis> y_;
  double panel_height_{kPanel};
};

}  // namespace

SvgPicture draw(const LinePlot& plot) { return Sheet(plot).draw(); }

std::string to_svg(const LinePlot& plot) { return svg_document(draw(plot)); }

}  // namespace fiducap
