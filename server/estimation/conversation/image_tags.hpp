#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include "estimation/filter/tag_measurement.hpp"

namespace fiducap {

/// What the map knows of a tag, or nullptr.
[[nodiscard]] inline const KnownTag* find_known(std::span<const KnownTag> known, int tag_id) {
  const auto found = std::find_if(known.begin(), known.end(),
                                  [&](const KnownTag& k) { return k.tag_id == tag_id; });
  return found == known.end() ? nullptr : &*found;
}

/// Whether a sighting may be of a tag at this place in camera axes, which is known to `sigma_m`:
/// two tags never overlap.
[[nodiscard]] inline bool is_seen_at(const TagObservation& seen, const Eigen::Vector3d& p_VT,
                                     double sigma_m, const CameraModel& camera) {
  constexpr double kLeast_px = 10.0;
  constexpr double kSigmas = 3.0;
  if (!(p_VT.z() > 0)) return false;
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  double side_px = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    centre += 0.25 * seen.corners_px[i];
    side_px = std::max(side_px, (seen.corners_px[i] - seen.corners_px[(i + 1) % 4]).norm());
  }
  return (centre - camera.pinhole(p_VT)).norm() <
         std::max(kLeast_px, 0.8 * side_px) + kSigmas * sigma_m * camera.fu / p_VT.z();
}

/// The tags of one image. Kept between images, for its memory.
struct ImageTags {
  std::vector<TagToUse> usable;  ///< They correct the state …
  std::vector<TagToUse> fresh;   ///< … and these may join it.
  std::vector<bool> accepted;    ///< Per usable one, by the last update.

  /// @param is_anchored  the map's places mean something to this filter
  template <class State>
  void sort(const TagObservations& seen, std::span<const KnownTag> known, const State& state,
            bool is_anchored) {
    usable.clear();
    fresh.clear();
    for (const TagObservation& tag : seen.tags) {
      const TagToUse use{&tag, state.find(tag.tag_id), find_known(known, tag.tag_id)};
      const bool is_usable = use.local >= 0 || (use.known != nullptr && is_anchored);
      (is_usable ? usable : fresh).push_back(use);
    }
  }

  /// After tags were given up: the others stand elsewhere in the state.
  template <class State>
  void find_again(const State& state) {
    for (std::size_t i = usable.size(); i-- > 0;) {
      usable[i].local = state.find(usable[i].seen->tag_id);
      if (usable[i].local >= 0 || usable[i].known != nullptr) continue;
      usable.erase(usable.begin() + static_cast<std::ptrdiff_t>(i));
      accepted.erase(accepted.begin() + static_cast<std::ptrdiff_t>(i));
    }
  }
};

}  // namespace fiducap
