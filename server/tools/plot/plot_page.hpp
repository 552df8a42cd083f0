#pragma once

#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/expected.hpp"

namespace fiducap {

using PlotPoint = std::pair<double, double>;

/// Distinct also with colour blindness (Okabe and Ito); the first is for the main curve.
inline constexpr const char* kPlotColors[]{"#0072b2", "#d55e00", "#009e73",
                                           "#cc79a7", "#e69f00", "#56b4e9"};
inline constexpr double kPlotGap = std::numeric_limits<double>::quiet_NaN();  ///< Breaks a line.
inline constexpr const char* kPlotGray = "#777";
inline constexpr const char* kPlotInk = "ink";  ///< That of the text, light on dark pages.

/// A curve, broken at points that are not finite.
struct PlotLine {
  std::string name;   ///< In the legend; empty: not named there.
  std::string color;  ///< CSS colour.
  std::vector<PlotPoint> points{};
  bool dashed{false};
  double width{1.4};
  bool dots{false};  ///< Single points, not connected.
};

/// A shaded part of the x axis.
struct PlotBand {
  double from{};
  double to{};
  std::string name;  ///< Written at its top.
};

/// Parts of the x axis with one meaning; one entry of the legend.
struct PlotSpans {
  std::string name;
  std::vector<PlotPoint> from_to{};
};

/// The area between two curves.
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

/// Vertical lines: events at these x.
struct PlotMarks {
  std::string name;
  std::string color;
  std::vector<double> at{};
};

/// Closed outlines with a label beside each, e.g. tags seen from above.
struct PlotShapes {
  struct Shape {
    std::vector<PlotPoint> outline;
    std::string label;  ///< Left out where it would overlap another one.
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
  std::vector<PlotArea> areas{};  ///< Cut off where few slices reach far beyond the lines.
  std::vector<PlotColumns> columns{};
  std::vector<PlotMarks> marks{};
  std::vector<PlotShapes> shapes{};
};

/// Panels below each other over the same x axis.
struct LinePlot {
  std::string title;
  std::string x_label;
  std::vector<PlotPanel> panels{};
  bool equal_axes{false};   ///< One unit has the same length on both axes (one panel).
  std::string subtitle{};   ///< Smaller.
  bool logarithmic{false};  ///< x.
  double panel_height{0};   ///< Pixels; 0: by the number of panels.
  bool y_down{false};       ///< y increases downwards, as in images.
};

/// Names and values, as they are shown.
struct PlotTable {
  std::string title;
  std::vector<std::pair<std::string, std::string>> rows;
};

/// A page of plots and figures.
struct PlotPage {
  std::string title;
  std::vector<std::string> remarks;  ///< A paragraph each.
  std::vector<LinePlot> plots;
  std::vector<PlotTable> tables;
};

/// The script that draws the plots, `plots.js` of the bundled web page (web/src/plots.ts).
/// @return Error when this installation has no page
[[nodiscard]] Expected<std::string> plot_script();

/// One HTML file that needs no other one: text and tables as HTML, the plots as JSON together with
/// the script that draws them. Long curves keep the extremes of each of 2000 columns. Without the
/// script the page has text and tables.
[[nodiscard]] std::string to_html(const PlotPage& page,
                                  const Expected<std::string>& script = plot_script());

}  // namespace fiducap
