#pragma once

#include <string>
#include <utility>
#include <vector>

#include "tools/plot/line_plot.hpp"

namespace fiducap {

/// Names and their values, both as they are to be read.
struct PlotTable {
  std::string title;
  std::vector<std::pair<std::string, std::string>> rows;
};

/// A page of pictures and figures.
struct PlotPage {
  std::string title;
  std::vector<std::string> remarks;  ///< A paragraph each.
  std::vector<LinePlot> plots;
  std::vector<PlotTable> tables;
};

/// @return one file that needs nothing else and runs nothing: bright or dark as the reader's
/// system is; on a narrow screen titles are wrapped, and wide pictures moved sideways. It is XML as
/// well.
[[nodiscard]] std::string to_html(const PlotPage& page);

/// @return the plots below each other in one SVG document
[[nodiscard]] std::string to_svg(const PlotPage& page);

}  // namespace fiducap
