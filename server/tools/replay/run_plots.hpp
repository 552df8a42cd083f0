#pragma once

#include <span>
#include <string>

#include "tools/plot/plot_page.hpp"
#include "tools/replay/evaluation.hpp"
#include "tools/replay/run_files.hpp"

namespace fiducap {

/// The page of a run, `plots.html`: the map from above with the paths of all bodies; for each body
/// over time its sigmas, the tags it saw, gaps without poses and events; figures and messages.
[[nodiscard]] PlotPage run_plots(std::span<const RunBody> bodies, const OfflineSession& session);

/// The page of an evaluation: errors over time with the filter's own 3-sigma band, in the axes and
/// from the instant of the printed numbers; the map from above beside the reference; histogram of
/// the reprojection. Without a reference: the filter's sigmas.
/// @param covariances  of the trajectory; empty: no band
[[nodiscard]] PlotPage evaluation_plots(const std::string& title, const RunResults& run,
                                        std::span<const StampedCovariance> covariances,
                                        const Evaluation& evaluation);

// Parts of plots. Times are seconds since `zero`.

/// Three median steps: two consecutive poses further apart leave a gap, because at least one image
/// between them has none. Several cameras take images in turn, so one step is not enough.
[[nodiscard]] Duration longest_step(std::span<const StampedPose> poses);

/// Gaps in the poses between `first` and `last` image. Without poses: all of it.
[[nodiscard]] PlotSpans missing_poses(std::span<const StampedPose> poses, Instant first,
                                      Instant last, Instant zero);

/// The path from above, broken where poses are missing.
[[nodiscard]] PlotLine path_of(const std::string& name, const std::string& color,
                               std::span<const StampedPose> poses);

/// Tags from above, with their ids.
[[nodiscard]] PlotShapes tags_from_above(const std::string& name, const std::string& color,
                                         std::span<const TagPlace> tags, bool filled);

/// x and y of the workspace to scale, one empty panel. The title has the number of tags.
[[nodiscard]] LinePlot map_from_above(std::size_t tags);

/// One half of a covariance.
enum class PoseHalf { kPosition, kRotation };

/// 1-sigma over all directions at each instant, millimetres or degrees, logarithmic; broken where
/// poses are missing, i.e. steps are longer than `longest`.
[[nodiscard]] PlotPanel sigma_panel(PoseHalf half, const std::string& color,
                                    std::span<const StampedCovariance> covariances, Instant zero,
                                    Duration longest);

}  // namespace fiducap
