#pragma once

#include <optional>
#include <span>
#include <vector>

#include "base/stamped_pose.hpp"
#include "capture/lens/camera_model.hpp"
#include "estimation/known_tag.hpp"
#include "pipeline/body_update.hpp"

namespace fiducap {

/// Its diagonal in the image.
[[nodiscard]] double size_px(const TagObservation& tag);

/// Where a body stands against one tag, as somebody proposes.
struct PlaceProposal {
  int tag_id{};
  Pose X_TB;
};

/// What the cameras of one body saw at one instant.
struct LoggedInstant {
  Instant at{};
  std::vector<TagObservations> images;
  std::vector<PlaceProposal> proposals;  ///< The filter's.
};

/// All images with tags of a body, to be gone through again when more is known.
class ImageLog final {
 public:
  void add(const BodyUpdate& update);
  /// @param X_WB   the filter's pose after this image, or nullopt while it has none
  /// @param tags   where the filter has its tags now (only those of `seen` are looked at)
  void add(const TagObservations& seen, const std::optional<Pose>& X_WB,
           std::span<const KnownTag> tags);
  [[nodiscard]] const std::vector<LoggedInstant>& instants() const { return instants_; }

 private:
  std::vector<LoggedInstant> instants_;
};

}  // namespace fiducap
