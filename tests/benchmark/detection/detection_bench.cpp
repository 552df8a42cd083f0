// fiducap_bench detection [--points]: tracking regions against libapriltag over whole images, and
// corner errors. Rendering is not measured. CPU time of this thread, which rises by a half on a
// busy machine, for all equally.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>

#include "bench.hpp"
#include "detection/runs.hpp"

namespace fiducap::bench {
namespace {

void print_tracking(const TrackingRunSetup& setup) {
  const auto arms = run_tracking(setup);
  if (arms.empty()) return;
  std::printf("\n%d x %d, %s: %d images, %.1f tags in view\n", setup.width, setup.height,
              setup.room.c_str(), setup.images,
              static_cast<double>(arms[0].in_view) / setup.images);
  std::printf("  %-28s %9s %9s %9s %8s %9s %9s %9s %6s %7s\n", "", "mean ms", "p50 ms", "p99 ms",
              "ratio", "recall", "of ref.", "rms px", "> 1 px", "whole");
  for (const SearchArm& arm : arms) {
    auto sorted = arm.cpu_us;
    std::sort(sorted.begin(), sorted.end());
    const auto at = [&](double share) {
      return sorted.empty() ? 0.0
                            : 1e-3 * sorted[static_cast<std::size_t>(
                                         share * static_cast<double>(sorted.size() - 1))];
    };
    std::printf("  %-28s %9.2f %9.2f %9.2f %8.1f %8.2f%% %8.2f%% %9.4f %6d ", arm.name.c_str(),
                1e-3 * arm.mean_us(), at(0.5), at(0.99), arms[0].mean_us() / arm.mean_us(),
                100.0 * arm.found / std::max(1, arm.in_view),
                100.0 * arm.found_of_reference / std::max(1, arm.reference), arm.rms_px(),
                arm.gross);
    if (arm.whole_share >= 0) {
      std::printf("%6.1f%%\n", 100 * arm.whole_share);
    } else {
      std::printf("%7s\n", "-");
    }
  }
}

void print_points(const PointRunSetup& setup) {
  const PointRun run = run_points(setup);
  auto sorted = run.cpu_ms;
  std::sort(sorted.begin(), sorted.end());
  if (sorted.empty()) return;
  const PointStatistics& s = run.statistics;
  std::printf(
      "\n%s, %s, %d x %d: %.1f points; CPU p50 %.2f p99 %.2f ms; %llu followed, %llu lost, %llu "
      "not back, %llu on tags, %llu moving, %llu begun\n",
      setup.room.c_str(), setup.texture.c_str(), setup.width, setup.height, run.points,
      sorted[sorted.size() / 2], sorted[sorted.size() * 99 / 100],
      static_cast<unsigned long long>(s.followed), static_cast<unsigned long long>(s.lost),
      static_cast<unsigned long long>(s.not_back), static_cast<unsigned long long>(s.on_tags),
      static_cast<unsigned long long>(s.moving), static_cast<unsigned long long>(s.begun));
  std::printf("  %4s %8s %8s %8s %6s\n", "age", "count", "rms px", "kept px", "gross");
  for (std::size_t age = 1; age < run.ages.size(); ++age) {
    const PointRun::AtAge& at = run.ages[age];
    if (at.coordinates < 40) continue;
    const double kept = at.products_px2 / at.coordinates;
    std::printf("  %4zu %8d %8.4f %8.4f %6d\n", age, at.coordinates / 2,
                std::sqrt(at.squares_px2 / at.coordinates),
                std::copysign(std::sqrt(std::abs(kept)), kept), at.gross);
  }
}

int run_detection(bool quick) {
  const auto images = [&](int full) { return quick ? std::max(10, full / 20) : full; };
  for (const char* room : {"hall", "table", "sparse", "loop", "ceiling"})
    print_tracking({room, 752, 480, images(200), 1});
  for (const char* room : {"hall", "ceiling"}) {
    print_tracking({room, 1280, 720, images(100), 1});
    print_tracking({room, 1920, 1080, images(60), 1});
  }
  print_corner_calibration(images(400));
  return 0;
}

int run_all_points() {
  for (const char* room : {"hall", "loop", "table"})
    for (const char* texture : {"sharp", "clutter", "plain"})
      print_points({room, texture, 752, 480, 300, 1});
  return 0;
}

}  // namespace

Bench add_detection(CLI::App& verb, const bool& quick) {
  const auto points = std::make_shared<bool>(false);
  verb.add_flag("--points", *points, "followed image points instead");
  return [points, &quick] { return *points ? run_all_points() : run_detection(quick); };
}

}  // namespace fiducap::bench
