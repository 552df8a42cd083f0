#pragma once

#include <array>
#include <functional>
#include <string>
#include <vector>

#include "paper/paper_run.hpp"
#include "tools/plot/plot_page.hpp"

namespace fiducap::bench {

/// Position of the body in the workspace by all filters and in truth, and the error.
[[nodiscard]] LinePlot position_plot(const std::string& title, const std::vector<PaperRun>& runs,
                                     const std::vector<std::string>& filters);
/// The same of the attitude: roll, pitch, yaw.
[[nodiscard]] LinePlot orientation_plot(const std::string& title, const std::vector<PaperRun>& runs,
                                        const std::vector<std::string>& filters);

using FigureAt = std::function<double(const PaperRun::At&)>;
/// x and y of every moment. @param of  NaN breaks the line
[[nodiscard]] std::vector<PlotPoint> points_of(const PaperRun& run, const FigureAt& of);
/// Adds a line for each filter. @param of  figure of a run at a moment
void add_lines(PlotPanel& panel, const std::vector<PaperRun>& runs,
               const std::vector<std::string>& filters,
               const std::function<double(const PaperRun&, const PaperRun::At&)>& of);

/// Adds RMS and largest error of position (mm), then of rotation (degrees), after kSettled_s, in
/// the reference tag's axes.
void add_motion(PaperResult& result, const PaperRuns& runs,
                const std::array<PaperFigure, 4>& figures);

}  // namespace fiducap::bench
