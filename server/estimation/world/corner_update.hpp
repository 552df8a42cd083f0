#pragma once

#include <optional>
#include <span>
#include <vector>

#include "estimation/body_estimate.hpp"
#include "estimation/filter/corner_noise.hpp"
#include "estimation/filter/stacked_update.hpp"
#include "estimation/world/filter_state.hpp"

namespace fiducap::world {

/// The update of RCARS II-D4 with all tags of one image jointly, optionally iterated. Keeps its
/// memory between images.
class CornerUpdate final {
 public:
  struct Options {
    GateLimits gate;
    int iterations{1};  ///< More than 1: iterated EKF, for a mean far from the corners.
    const FilterState* start{nullptr};  ///< First linearisation point; nullptr: the prior mean.
    bool wants_score{false};            ///< Computes shared_score(), which costs another division.
  };

  /// @param noise     of this camera's corners; learns from every tag
  /// @param accepted  out: per entry of `tags`, whether it was used
  UpdateReport apply(FilterState& state, int camera, const CameraModel& model,
                     std::span<const TagToUse> tags, const Options& options, CornerNoise& noise,
                     std::vector<bool>& accepted);

  /// Score of the camera's pose by the accepted tags of the last image, by all of them when at
  /// least half were rejected; nullopt: none, or not wanted.
  [[nodiscard]] const std::optional<StackedUpdate::SharedScore>& shared_score() const {
    return score_;
  }

 private:
  void score_all(const FilterState& state);

  FilterState prior_;  ///< mean only
  ImageMeasurement image_;
  StackedUpdate update_;
  std::vector<std::size_t> gated_;
  std::optional<StackedUpdate::SharedScore> score_;
};

}  // namespace fiducap::world
