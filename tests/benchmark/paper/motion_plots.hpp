#pragma once

#include "paper/paper_run.hpp"
#include "tools/plot/plot_page.hpp"

namespace fiducap::bench {

/// Position of the body in the workspace by all filters and in truth, and how far they are apart.
[[nodiscard]] LinePlot position_plot(const std::string& title, const std::vector<PaperRun>& runs,
                                     const std::vector<std::string>& filters);
/// The same of the attitude: roll, pitch, yaw.
[[nodiscard]] LinePlot orientation_plot(const std::string& title, const std::vector<PaperRun>& runs,
                                        const std::vector<std::string>& filters);

/// x and y of every moment. @param of  NaN breaks the line
[[nodiscard]] std::vector<PlotPoint> points_of(
    const PaperRun& run, const std::function<double(const PaperRun::At&)>& of);

/// RMS and largest error of the motion after kSettled_s, in the reference tag's axes.
[[nodiscard]] double position_rmse_mm(const PaperRun& run);
[[nodiscard]] double position_worst_mm(const PaperRun& run);
[[nodiscard]] double rotation_rmse_deg(const PaperRun& run);
[[nodiscard]] double rotation_worst_deg(const PaperRun& run);

}  // namespace fiducap::bench
