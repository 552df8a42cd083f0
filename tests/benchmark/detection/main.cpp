// fiducap_detection_bench [--quick]: tracking regions against libapriltag over whole images, and
// how far corners are off. Rendering is not measured. CPU time of this thread; it goes up by a half
// when the machine is busy, for all alike.
#include <algorithm>
#include <cstdio>
#include <cstring>

#include "detection/corner_calibration.hpp"
#include "detection/tracking_run.hpp"

namespace fiducap::bench {
namespace {

void print(const TrackingRunSetup& setup) {
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

}  // namespace
}  // namespace fiducap::bench

int main(int argc, char** argv) {
  using namespace fiducap::bench;
  const bool quick = argc == 2 && std::strcmp(argv[1], "--quick") == 0;
  if (argc > 1 && !quick) {
    std::fprintf(stderr, "usage: fiducap_detection_bench [--quick]\n");
    return 2;
  }
  const auto images = [&](int full) { return quick ? std::max(10, full / 20) : full; };
  for (const char* room : {"hall", "table", "sparse", "loop", "ceiling"})
    print({room, 752, 480, images(200), 1});
  for (const char* room : {"hall", "ceiling"}) {
    print({room, 1280, 720, images(100), 1});
    print({room, 1920, 1080, images(60), 1});
  }
  print_corner_calibration(images(400));
  return 0;
}
