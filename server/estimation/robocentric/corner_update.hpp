#pragma once

#include <span>
#include <vector>

#include "capture/camera_model.hpp"
#include "estimation/body_estimate.hpp"
#include "estimation/robocentric/filter_state.hpp"
#include "estimation/stacked_update.hpp"

namespace fiducap::robocentric {

/// Innovation and Jacobian of one tag, RCARS II-D4. A tag in the state depends on itself alone when camera 0 sees it
/// (that is what robocentric is good for); another camera adds both extrinsics; a known tag depends on the body.
[[nodiscard]] TagMeasurement measure(const FilterState& state, int camera, const CameraModel& model, const TagToUse& tag,
                                     double corner_noise_px);

/// Where the tag stands in the axes of `camera`, by the state's mean.
[[nodiscard]] Pose predicted_tag(const FilterState& state, int camera, const TagToUse& tag);

/// The Kalman update with all tags of one image at once. Keeps its memory between images.
class CornerUpdate final {
 public:
  struct Options {
    double corner_noise_px{};
    double gate{};        ///< Chi-square limit for the 8 numbers of one tag; a tag above it is left out.
    int iterations{1};    ///< 1: plain EKF. More: iterated, for a first image far from the linearisation point.
    /// Where the first linearisation is done, when somebody knows better than the prior mean; nullptr: at the prior.
    const FilterState* start{nullptr};
  };

  /// @param accepted  out: per entry of `tags`, whether it was used
  UpdateReport apply(FilterState& state, int camera, const CameraModel& model, std::span<const TagToUse> tags,
                     const Options& options, std::vector<bool>& accepted);

 private:
  void build(const FilterState& state, int camera, const CameraModel& model, std::span<const TagToUse> tags,
             double corner_noise_px);
  void refer_to(const FilterState& prior, const FilterState& state);

  std::vector<TagMeasurement> measurements_;
  StackedUpdate update_;
};

}  // namespace fiducap::robocentric
