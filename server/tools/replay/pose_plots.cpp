#include "tools/replay/pose_plots.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "detection/tag_pose.hpp"

namespace fiducap {
namespace {

constexpr double kNowhere = std::numeric_limits<double>::quiet_NaN();
constexpr double kMmPerMetre = 1e3;
constexpr double kDegreesPerRadian = 180 / std::numbers::pi;

}  // namespace

Duration longest_step(std::span<const StampedPose> poses) {
  constexpr int kUsualSteps = 3;
  std::vector<Duration> steps;
  for (std::size_t i = 1; i < poses.size(); ++i) steps.push_back(poses[i].at - poses[i - 1].at);
  if (steps.empty()) return Duration::max();
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  return kUsualSteps * *middle;
}

PlotSpans missing_poses(std::span<const StampedPose> poses, Instant first, Instant last,
                        Instant zero) {
  PlotSpans spans{"no pose", {}};
  const Duration longest = longest_step(poses);
  const auto add = [&](Instant from, Instant to, Duration most) {
    if (to - from > most)
      spans.from_to.emplace_back(to_seconds(from - zero), to_seconds(to - zero));
  };
  if (first > last) return spans;
  if (poses.empty()) {
    add(first, last, Duration{-1});
    return spans;
  }
  add(first, poses.front().at, longest);
  for (std::size_t i = 1; i < poses.size(); ++i) add(poses[i - 1].at, poses[i].at, longest);
  add(poses.back().at, last, longest);
  return spans;
}

PlotLine way_of(const std::string& name, const std::string& color,
                std::span<const StampedPose> poses) {
  PlotLine line{name, color, {}};
  const Duration longest = longest_step(poses);
  for (std::size_t i = 0; i < poses.size(); ++i) {
    if (i > 0 && poses[i].at - poses[i - 1].at > longest)
      line.points.emplace_back(kNowhere, kNowhere);
    line.points.emplace_back(poses[i].X_WB.p.x(), poses[i].X_WB.p.y());
  }
  return line;
}

PlotShapes tags_from_above(const std::string& name, const std::string& color,
                           std::span<const TagPlace> tags, bool filled) {
  PlotShapes shapes{name, color, {}, filled};
  for (const TagPlace& tag : tags) {
    PlotShapes::Shape shape{{}, std::to_string(tag.tag_id)};
    for (int corner = 0; corner < 4; ++corner) {
      const Eigen::Vector3d p = tag.X_WT * tag_corner(corner, tag.edge_m);
      shape.outline.emplace_back(p.x(), p.y());
    }
    shapes.shapes.push_back(std::move(shape));
  }
  return shapes;
}

LinePlot map_from_above(std::size_t tags) {
  LinePlot plot{"Map from above: " + std::to_string(tags) + (tags == 1 ? " tag" : " tags"),
                "x of the workspace, m",
                {{"y, m"}}};
  plot.subtitle = "Looking along z of the workspace; a tag on a wall is a stroke.";
  plot.equal_axes = true;
  return plot;
}

PlotLine sigma_line(const std::string& name, const std::string& color,
                    std::span<const StampedCovariance> covariances, PoseHalf half, Instant zero,
                    Duration longest) {
  PlotLine line{name, color, {}};
  const bool is_position = half == PoseHalf::kPosition;
  for (std::size_t i = 0; i < covariances.size(); ++i) {
    const StampedCovariance& at = covariances[i];
    if (i > 0 && at.at - covariances[i - 1].at > longest)
      line.points.emplace_back(kNowhere, kNowhere);
    const Matrix6d& P = at.covariance;
    const double variance =
        is_position ? P.diagonal().head<3>().sum() : P.diagonal().tail<3>().sum();
    line.points.emplace_back(to_seconds(at.at - zero),
                             (is_position ? kMmPerMetre : kDegreesPerRadian) * std::sqrt(variance));
  }
  return line;
}

PlotPanel sigma_panel(PoseHalf half) {
  PlotPanel panel{half == PoseHalf::kPosition ? "position σ, mm" : "attitude σ, °"};
  panel.logarithmic = true;
  return panel;
}

}  // namespace fiducap
