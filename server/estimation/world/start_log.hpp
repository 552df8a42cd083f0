#pragma once

#include <algorithm>
#include <optional>
#include <span>
#include <vector>

#include "capture/imu_sample.hpp"
#include "detection/tag_observation.hpp"
#include "estimation/known_tag.hpp"

namespace fiducap::world {

/// One way to live through the start: the clocks' shifts guessed, and how much they may learn.
struct StartLife {
  std::vector<double> shifts_s;  ///< One per camera.
  double spread{};  ///< 1-sigma of the guess, in sigmas of the configured shift; 0: held.
  double cost{};  ///< How badly it explains the images, −2 log likelihood but for a constant …
  double numbers{};  ///< … of so many numbers.

  /// @param configured_s  1-sigma of a camera's shift
  [[nodiscard]] double sigma_s(double configured_s) const {
    constexpr double kHeld_s = 0.001;  // a clock that is held may be off by so much
    return std::max(std::min(kHeld_s, configured_s), spread * configured_s);
  }
};

/// All that went into the filter since it started, as long as it may have to start again with a
/// better clock.
class StartLog final {
 public:
  struct Image {
    TagObservations seen;
    std::vector<KnownTag> known;
  };

  void add(const ImuSample& imu);
  /// Images before the first tag are not kept.
  void add(const TagObservations& seen, std::span<const KnownTag> known);
  /// More came in, or for longer, than a start is worth: it has to be closed, or begun again.
  [[nodiscard]] bool is_full() const;
  /// Nothing is kept any more.
  void close();
  [[nodiscard]] bool is_open() const { return open_; }
  /// 0 before the first tag.
  [[nodiscard]] double seconds_since_first_tag(Instant now) const;
  /// Puts other clock shifts into the images' times, one per camera, and the images in that order.
  void shift_images(std::span<const double> shifts_s);
  [[nodiscard]] const std::vector<ImuSample>& imu() const { return imu_; }
  [[nodiscard]] const std::vector<Image>& images() const { return images_; }

 private:
  bool open_{true};
  std::size_t sightings_{0};
  std::vector<ImuSample> imu_;
  std::vector<Image> images_;
};

}  // namespace fiducap::world
