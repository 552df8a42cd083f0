#pragma once

#include <span>
#include <string>
#include <vector>

#include "pipeline/replay/offline_run.hpp"
#include "tools/plot/line_plot.hpp"
#include "tools/replay/pose_errors.hpp"

namespace fiducap {

/// How poses, tags and covariances become parts of plots. Time is told in seconds since `zero`.

/// Two poses in a row that are further apart leave a gap: at least one image between them has none.
/// Cameras may take turns or miss an image, so it is three usual steps.
[[nodiscard]] Duration longest_step(std::span<const StampedPose> poses);

/// Where poses are missing between `first` and `last` image. None at all: everywhere.
[[nodiscard]] PlotSpans missing_poses(std::span<const StampedPose> poses, Instant first,
                                      Instant last, Instant zero);

/// The way from above, broken where poses are missing.
[[nodiscard]] PlotLine way_of(const std::string& name, const std::string& color,
                              std::span<const StampedPose> poses);

/// Tags from above, with their ids.
[[nodiscard]] PlotShapes tags_from_above(const std::string& name, const std::string& color,
                                         std::span<const TagPlace> tags, bool filled);

/// x and y of the workspace to scale; what looks down on it is put into its only panel.
/// The title says how many tags there are.
[[nodiscard]] LinePlot map_from_above(std::size_t tags);

/// Which half of a covariance.
enum class PoseHalf { kPosition, kRotation };

/// How sure a pose was at each instant: 1-sigma over all directions, millimetres or degrees; broken
/// where poses are missing.
[[nodiscard]] PlotLine sigma_line(const std::string& name, const std::string& color,
                                  std::span<const StampedCovariance> covariances, PoseHalf half,
                                  Instant zero, Duration longest);

/// Panels of it, with logarithmic y.
[[nodiscard]] PlotPanel sigma_panel(PoseHalf half);

}  // namespace fiducap
