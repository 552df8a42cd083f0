#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>

#include <Eigen/Core>

#include "capture/gray_image.hpp"

namespace fiducap {

/// A line n·x = c.
struct Line {
  Eigen::Vector2d n;
  double c;
};

/// Line through `mean` along the larger axis of a covariance.
[[nodiscard]] Line principal_line(const Eigen::Vector2d& mean, const Eigen::Matrix2d& covariance);

[[nodiscard]] Eigen::Vector2d intersection(const Line& a, const Line& b);

/// Least-squares line through points.
class LineFit final {
 public:
  static constexpr int kMinPoints = 4;

  explicit LineFit(const Eigen::Vector2d& origin) : origin_(origin) {}
  void add(const Eigen::Vector2d& px) {
    const Eigen::Vector2d edge = px - origin_;
    sum_ += edge;
    squares_ += edge * edge.transpose();
    ++points_;
  }
  /// @return nullopt for fewer than kMinPoints
  [[nodiscard]] std::optional<Line> line() const;
  [[nodiscard]] int points() const { return points_; }

 private:
  Eigen::Vector2d origin_;  // keeps the sums small
  Eigen::Vector2d sum_{Eigen::Vector2d::Zero()};
  Eigen::Matrix2d squares_{Eigen::Matrix2d::Zero()};
  int points_{0};
};

/// Locates a tag's side across itself, from one point near it, by the gray between pixels. Lengths
/// in pixels; `outward` has unit length.
struct SideScan {
  /// Borders narrower than this share their pixels with their neighbours on both sides.
  static constexpr double kWide_px = 4.0;

  const GrayImage& image;
  double reach_px;     ///< Searched to both sides of the point.
  double gradient_px;  ///< Half of the distance over which the gradient is taken.

  [[nodiscard]] bool holds(const Eigen::Vector2d& px) const {
    return px.x() >= 0 && px.y() >= 0 && px.x() < image.width - 1 && px.y() < image.height - 1;
  }

  /// Bilinear. @pre holds(px)
  [[nodiscard]] double gray(const Eigen::Vector2d& px) const {
    const int u = static_cast<int>(px.x());
    const int v = static_cast<int>(px.y());
    const double a = px.x() - u;
    const double b = px.y() - v;
    const std::uint8_t* p = image.pixels.data() +
                            static_cast<std::size_t>(v) * static_cast<std::size_t>(image.width) + u;
    return (1 - b) * ((1 - a) * p[0] + a * p[1]) +
           b * ((1 - a) * p[image.width] + a * p[image.width + 1]);
  }

  /// Position of the rise of gray along `outward`, weighted by the squared gradient.
  struct Rise {
    double mean_px;
    double variance_px2;
  };
  /// Little noise, but in sharp images biased to the middle of pixels by up to 0.05 px.
  /// @param max_gray  brighter is not the tag's paper
  /// @return nullopt: no rise, or the image ends within reach
  [[nodiscard]] std::optional<Rise> rise(const Eigen::Vector2d& px, const Eigen::Vector2d& outward,
                                         double max_gray) const;

  /// Outward bias of a rise by the next cells: white bits inside of the border delay its begin, a
  /// dark wall beyond the quiet zone ends it early.
  [[nodiscard]] double bias_px(const Eigen::Vector2d& px, const Eigen::Vector2d& outward,
                               double cell_px) const;

  /// Position along `outward` of the ideal edge with the same sum of gray from `half_px` inside to
  /// `half_px` outside. Unbiased for all positions on the grid of pixels and all lenses when black
  /// and white are uniform from there to `uniform_px`.
  /// @return nullopt: no step from black to white, or the image ends
  [[nodiscard]] std::optional<double> balance(const Eigen::Vector2d& px,
                                              const Eigen::Vector2d& outward, double half_px,
                                              double uniform_px) const;

 private:
  [[nodiscard]] double mean_gray(const Eigen::Vector2d& px, const Eigen::Vector2d& outward,
                                 double from_px, double to_px) const;
};

/// Gray across a side, mean over many points along it, at even distances from one cell inside
/// (first) to one cell outside of the assumed side.
using SideProfile = std::array<double, 25>;

/// In cells.
struct BlurredEdge {
  double offset{};  ///< From the assumed side outwards.
  double blur{};    ///< Length.
};

/// Gray of a tag's border and of its quiet zone.
struct TagLevels {
  double black{};
  double white{};
};

/// Locates the edge between black border and quiet zone in a profile that motion, or narrow cells,
/// blurred so far that bits and wall reach it.
///
/// Bits, border, quiet zone and wall are four grays with edges one cell apart, blurred over a
/// length. Length, position and grays are fitted: the steepest point is biased when bits and wall
/// differ unequally from their neighbours.
/// @param blur    start value, cells
/// @param levels  where they are known; without them the grays are less certain
/// @return nullopt where the model does not explain the profile
[[nodiscard]] std::optional<BlurredEdge> find_blurred_edge(
    const SideProfile& gray, double blur, const std::optional<TagLevels>& levels = std::nullopt);

}  // namespace fiducap
