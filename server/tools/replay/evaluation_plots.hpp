#pragma once

#include <span>
#include <string>
#include <vector>

#include "pipeline/replay/offline_run.hpp"
#include "tools/plot/plot_page.hpp"
#include "tools/replay/evaluation.hpp"

namespace fiducap {

/// What an evaluation looks like: errors over time with the filter's own 3-sigma band, in the axes
/// and from the instant of the printed numbers; the map from above beside the reference; how the
/// corners fit. Where there is no reference: how sure the filter was.
/// @param covariances  of the trajectory; empty: no band
[[nodiscard]] PlotPage evaluation_plots(const std::string& title, const RunResults& run,
                                        std::span<const StampedCovariance> covariances,
                                        const Evaluation& evaluation);

/// Of the instants of `<body>.tum`, from beside it. @return empty when the run has none
[[nodiscard]] Expected<std::vector<StampedCovariance>> covariances_beside(const std::string& tum);

/// Whether `path` ends as something that can be written; asked before the work.
[[nodiscard]] Expected<void> check_plot_path(const std::string& path);
/// By its ending: `.html` a page, `.svg` the pictures alone.
[[nodiscard]] Expected<void> write_plots(const std::string& path, const PlotPage& page);

}  // namespace fiducap
