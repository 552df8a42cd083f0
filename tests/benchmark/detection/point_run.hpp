#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "detection/points/point_tracker.hpp"

namespace fiducap::bench {

struct PointRunSetup {
  std::string room{"hall"};
  std::string texture{"sharp"};
  int width{752};
  int height{480};
  int images{200};
  std::uint64_t seed{1};
};

/// Points followed through rendered images, against where the places on the walls that they showed
/// first are seen now.
struct PointRun {
  /// Errors of all tracks at one age, raw pixels; far off ones apart.
  struct AtAge {
    double squares_px2{};
    double products_px2{};  ///< … times the error one report before: what stays of an error.
    int coordinates{};
    int gross{};  ///< More than kGross_px off, or a coordinate is.
  };
  static constexpr double kGross_px = 1.5;
  static constexpr int kAges = 20;
  std::vector<AtAge> ages{std::vector<AtAge>(kAges)};
  std::vector<double> cpu_ms;  ///< One per image.
  double points{};             ///< Mean per report.
  PointStatistics statistics;
};

/// Renders a robot's flight (752 × 480 with a lens, 20 Hz) and follows points. The turning of the
/// camera is the truth's.
[[nodiscard]] PointRun run_points(const PointRunSetup& setup);

}  // namespace fiducap::bench
