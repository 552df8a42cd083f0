#pragma once

#include <map>
#include <string>
#include <vector>

#include "capture/camera_frame.hpp"

namespace fiducap::bench {

/// One way to find the tags of the same images.
struct SearchArm {
  std::string name;
  std::vector<double> cpu_us{};  ///< One per image, thread CPU time.
  int found{};                   ///< Of the tags that are truly in view …
  int in_view{};
  int found_of_reference{};  ///< … and of those that the reference found.
  int reference{};
  int gross{};           ///< Found, but a corner more than a pixel off.
  double squares_px2{};  ///< Of the others.
  int coordinates{};
  double whole_share{
      -1};  ///< Of images that were searched whole, after the start; −1: does not apply.

  [[nodiscard]] double mean_us() const;
  [[nodiscard]] double rms_px() const;
};

struct TrackingRunSetup {
  std::string room{"hall"};
  int width{752};
  int height{480};
  int images{200};
  std::uint64_t seed{1};
};

/// Renders a robot's flight (camera 20 Hz with a lens, IMU 200 Hz), shows every image to
///  0 libapriltag over the whole image, decimate 1, as it comes out of the box: the reference,
///  1 the same with the contrast threshold from the measured noise,
///  2 libapriltag over the whole image, decimate 2,
///  3 TagSearch with expectations from the truth of the image before: carried on at its velocity, 5
///  mm and 0.3° off, 4 GuidedSearch behind the world filter, which starts with nothing and
///  learns the room.
/// The first second is not counted: there is nothing to track yet.
[[nodiscard]] std::vector<SearchArm> run_tracking(const TrackingRunSetup& setup);

}  // namespace fiducap::bench
