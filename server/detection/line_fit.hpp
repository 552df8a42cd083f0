#pragma once

#include <cmath>
#include <optional>

#include <Eigen/Core>

namespace fiducap {

/// A line n·x = c.
struct Line {
  Eigen::Vector2d n;
  double c;
};

/// A line through points, least squares.
class LineFit final {
 public:
  static constexpr int kFewestPoints = 4;

  explicit LineFit(const Eigen::Vector2d& origin) : origin_(origin) {}
  void add(const Eigen::Vector2d& px) {
    const Eigen::Vector2d edge = px - origin_;
    sum_ += edge;
    squares_ += edge * edge.transpose();
    ++seen_;
  }
  [[nodiscard]] std::optional<Line> line() const {
    if (seen_ < kFewestPoints) return std::nullopt;
    const Eigen::Vector2d mean = sum_ / seen_;
    const Eigen::Matrix2d C = squares_ / seen_ - mean * mean.transpose();
    const double angle =
        0.5 * std::atan2(2 * C(0, 1), C(0, 0) - C(1, 1));  // direction of the longer axis
    const Eigen::Vector2d n(-std::sin(angle), std::cos(angle));
    return Line{n, n.dot(mean + origin_)};
  }
  [[nodiscard]] int seen() const { return seen_; }

 private:
  Eigen::Vector2d origin_;  // sums stay small
  Eigen::Vector2d sum_{Eigen::Vector2d::Zero()};
  Eigen::Matrix2d squares_{Eigen::Matrix2d::Zero()};
  int seen_{0};
};

}  // namespace fiducap
