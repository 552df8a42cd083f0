#pragma once

#include <string>
#include <utility>
#include <vector>

namespace fiducap {

/// A line of a chart.
struct ChartSeries {
  std::string name;
  std::string color;                              ///< SVG colour.
  bool dashed{false};                             ///< A model, not a measurement.
  std::vector<std::pair<double, double>> points;  ///< Positive; others are left out.
};

/// A chart with both axes logarithmic.
struct LogLogChart {
  std::string title;
  std::string x_label;
  std::string y_label;
  std::vector<ChartSeries> series;
};

/// Draws charts beside each other, each with grid, ticks at powers of ten and a legend.
/// @return an SVG document; texts are escaped
[[nodiscard]] std::string to_svg(const std::vector<LogLogChart>& charts);

}  // namespace fiducap
