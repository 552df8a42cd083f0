#pragma once

#include <optional>
#include <span>
#include <vector>

#include "base/pose.hpp"
#include "capture/lens/camera_model.hpp"
#include "capture/recording/odometry.hpp"
#include "estimation/known_tag.hpp"
#include "estimation/start/place_search.hpp"
#include "pipeline/body_update.hpp"

namespace fiducap {

/// Diagonal of a tag in the image.
[[nodiscard]] double size_px(const TagObservation& tag);

/// A proposed pose of a body relative to a tag.
struct PlaceProposal {
  int tag_id{};
  Pose X_TB;
};

/// The images of one body at one instant.
struct LoggedInstant {
  Instant at{};
  std::vector<TagObservations> images;
  std::vector<PlaceProposal> proposals;  ///< The filter's.
};

/// All images with tags of a body, for solving again when more is known.
class ImageLog final {
 public:
  void add(const BodyUpdate& update);
  /// @param X_WB   the filter's pose after this image; nullopt: none
  /// @param tags   poses of the tags at this time (only those of `seen` are used)
  void add(const TagObservations& seen, const std::optional<Pose>& X_WB,
           std::span<const KnownTag> tags);
  [[nodiscard]] const std::vector<LoggedInstant>& instants() const { return instants_; }

 private:
  std::vector<LoggedInstant> instants_;
};

/// Squared norm of a sighting's eight residuals, in units of the noise, with the largest influence:
/// 5 sigma each (Cauchy loss).
inline constexpr double kSightingBend = 8 * 5.0 * 5.0;

struct CostedPose {
  Pose X;
  double cost{};
};

/// Cauchy cost of sightings by a body at X_AB.
[[nodiscard]] double misfit(std::span<const SightedTag> tags, const Pose& X_AB, double noise_px);
/// Local minimum near X_AB: first with rough inliers, then with inliers.
[[nodiscard]] Pose improved(const Pose& X_AB, std::span<const SightedTag> tags, double noise_px);
/// Squared sigmas of the motion between two poses: by odometry if there is some, else of a body
/// carried by hand.
[[nodiscard]] double motion_misfit(const StampedPose& a, const StampedPose& b,
                                   const Odometry* odometry);

}  // namespace fiducap
