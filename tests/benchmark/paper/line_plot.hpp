#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace fiducap::bench {

using PlotPoint = std::pair<double, double>;

/// A line, or a stack of short ones where points are not finite.
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

/// One pair of linear axes.
struct PlotPanel {
  std::string y_label;
  std::vector<PlotLine> lines{};
  std::vector<PlotBand> bands{};
  std::optional<double> goal{};  ///< A dashed line to stay below; named in the legend.
  bool from_zero{false};         ///< y starts at 0.
};

/// Panels below each other over the same x axis.
struct LinePlot {
  std::string title;
  std::string x_label;
  std::vector<PlotPanel> panels{};
  bool equal_axes{false};  ///< A metre is as long across as it is up (one panel).
};

/// @return an SVG document; texts are escaped. Long lines keep the extremes of every pixel column,
/// so that noise stays visible; points that a quarter of a pixel would not show are left out.
[[nodiscard]] std::string to_svg(const LinePlot& plot);

}  // namespace fiducap::bench
