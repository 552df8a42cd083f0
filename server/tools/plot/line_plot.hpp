#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "tools/plot/svg_parts.hpp"

namespace fiducap {

using PlotPoint = std::pair<double, double>;

/// Told apart also by people who do not see all colours (Okabe and Ito); the first is for what is
/// looked at.
inline constexpr const char* kPlotColors[]{"#0072b2", "#d55e00", "#009e73",
                                           "#cc79a7", "#e69f00", "#56b4e9"};
inline constexpr const char* kPlotGray = "#777";

/// A line, or a stack of short ones where points cannot be shown.
struct PlotLine {
  std::string name;   ///< In the legend; empty: not named there.
  std::string color;  ///< SVG colour.
  std::vector<PlotPoint> points{};
  bool dashed{false};
  double width{1.4};
};

/// A shaded part of the x axis.
struct PlotBand {
  double from{};
  double to{};
  std::string name;  ///< Written at its top.
};

/// Parts of the x axis that all say the same; once in the legend.
struct PlotSpans {
  std::string name;
  std::vector<PlotPoint> from_to{};
};

/// What lies between two borders.
struct PlotArea {
  struct Slice {
    double x{}, low{}, high{};
  };
  std::string name;
  std::string color;
  std::vector<Slice> slices{};  ///< x does not decrease; broken where one is not finite.
};

/// Columns of a histogram.
struct PlotColumns {
  struct Column {
    double from{}, to{}, height{};
  };
  std::string name;
  std::string color;
  std::vector<Column> columns{};
  bool filled{true};
};

/// Upright strokes: what happened at these x.
struct PlotMarks {
  std::string name;
  std::string color;
  std::vector<double> at{};
};

/// Closed outlines with a word beside each, e.g. tags seen from above.
struct PlotShapes {
  struct Shape {
    std::vector<PlotPoint> outline;
    std::string label;  ///< Left out where it would lie on another one.
  };
  std::string name;
  std::string color;
  std::vector<Shape> shapes{};
  bool filled{true};
};

/// One pair of axes.
struct PlotPanel {
  std::string y_label;
  std::vector<PlotLine> lines{};
  std::vector<PlotBand> bands{};
  std::optional<double> goal{};  ///< A dashed line to stay below; named in the legend.
  bool from_zero{false};         ///< y starts at 0.
  bool logarithmic{false};       ///< y.
  std::vector<PlotSpans> spans{};
  /// Cut off where they reach far beyond lines: those are what is looked at.
  std::vector<PlotArea> areas{};
  std::vector<PlotColumns> columns{};
  std::vector<PlotMarks> marks{};
  std::vector<PlotShapes> shapes{};
};

/// Panels below each other over the same x axis.
struct LinePlot {
  std::string title;
  std::string x_label;
  std::vector<PlotPanel> panels{};
  bool equal_axes{false};   ///< A metre is as long across as it is up (one panel).
  std::string subtitle{};   ///< Smaller, wrapped.
  bool logarithmic{false};  ///< x.
  double panel_height{0};   ///< 0: by the number of panels.
};

/// Long lines keep the extremes of every pixel column, so that noise and peaks stay visible
/// (thinning). Texts are escaped.
[[nodiscard]] SvgPicture draw(const LinePlot& plot);
/// @return an SVG document
[[nodiscard]] std::string to_svg(const LinePlot& plot);

}  // namespace fiducap
