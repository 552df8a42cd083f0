#include "pipeline/late_images.hpp"

#include <fmt/format.h>

#include <utility>

namespace fiducap {

std::string LateImages::take_news(int camera) {
  Camera& of = cameras_[static_cast<std::size_t>(camera)];
  if (!of.only_watched || std::exchange(of.is_told, true)) return {};
  return fmt::format(
      "images of camera {} are stamped {:.2f} s before readings of the IMU that came earlier: they "
      "are too late to be used, and poses are withheld. Correct bodies[].cameras[].time_shift_s, "
      "or what sets the clocks of camera and IMU; turn the body about all three axes, and it is "
      "said by how much they are off",
      camera, to_seconds(of.behind));
}

}  // namespace fiducap
