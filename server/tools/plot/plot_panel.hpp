#pragma once

#include <string>
#include <vector>

#include "tools/plot/line_plot.hpp"
#include "tools/plot/plot_axis.hpp"

namespace fiducap {

/// The range of y that a panel needs.
[[nodiscard]] PlotAxis y_axis_of(const PlotPanel& panel, PlotAxis::Ends ends);

/// Draws one panel of a plot into its place on the sheet.
class PanelDrawing final {
 public:
  /// The plot area, in pixels.
  struct Place {
    double left{}, top{}, width{}, height{};
  };

  /// The panel stays with the caller.
  PanelDrawing(const PlotPanel& panel, const PlotAxis& x, const PlotAxis& y, const Place& place)
      : panel_(panel), x_(x), y_(y), place_(place) {}

  /// @param has_x_labels  of the lowest panel
  [[nodiscard]] std::string draw(bool has_x_labels) const;

 private:
  [[nodiscard]] double bottom() const { return place_.top + place_.height; }
  [[nodiscard]] double px(double x) const { return place_.left + x_.share(x) * place_.width; }
  [[nodiscard]] double py(double y) const { return bottom() - y_.share(y) * place_.height; }
  /// What is beyond the axis lies at its end.
  [[nodiscard]] double clamped_py(double y) const;
  [[nodiscard]] bool can_show(const PlotPoint& p) const {
    return x_.can_show(p.first) && y_.can_show(p.second);
  }

  [[nodiscard]] std::string shaded() const;
  [[nodiscard]] std::string grid(bool has_x_labels) const;
  [[nodiscard]] std::string area(const PlotArea& area) const;
  [[nodiscard]] std::string columns(const PlotColumns& columns) const;
  [[nodiscard]] std::string path(const PlotLine& line) const;
  [[nodiscard]] std::string marks(const PlotMarks& marks) const;
  [[nodiscard]] std::string outlines(const PlotShapes& shapes) const;
  [[nodiscard]] std::string labels() const;

  const PlotPanel& panel_;
  const PlotAxis& x_;
  const PlotAxis& y_;
  Place place_;
};

/// What names the parts of a panel, in rows above it.
class PlotLegend final {
 public:
  PlotLegend(const PlotPanel& panel, double width);

  [[nodiscard]] double height() const;
  [[nodiscard]] std::string draw(double left, double top) const;

 private:
  /// What stands before a name.
  struct Entry {
    enum class Kind { kLine, kBox, kStroke } kind{Kind::kLine};
    std::string name;
    std::string style;
  };
  void add(const Entry& entry);

  double width_;
  double used_{0};  ///< Of the last row.
  std::vector<std::vector<Entry>> rows_;
};

}  // namespace fiducap
