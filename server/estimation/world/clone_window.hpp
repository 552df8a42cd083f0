#pragma once

#include <cstdint>
#include <vector>

#include "estimation/world/image_memory.hpp"
#include "estimation/world/landmark_update.hpp"

namespace fiducap::world {

/// The cameras of the last images, as clones in the state, and what points they saw: decides which
/// track is used when.
///
/// A track is used once it ends, or once it is as long as the window; its next stretch is then a
/// landmark of its own. That follows from the ages of its points alone, so an image that is
/// followed again (ImageMemory) uses what it used the first time, and nothing needs to be
/// remembered besides the clones and the images.
class CloneWindow final {
 public:
  static constexpr int kClones = 10;

  CloneWindow(std::size_t cameras, const LandmarkRules& rules);

  /// Takes in an image with points, at which the state stands: the oldest clone becomes this camera
  /// now.
  static void clone(FilterState& state, int camera, long image);
  /// Corrects the state by the tracks that are due with this image. @pre clone() was called for it
  LandmarkReport correct(FilterState& state, ImageMemory& memory, const CameraModel& model,
                         int camera);

 private:
  struct Seen {
    int slot;
    const TagObservations* image;
  };

  void list_images(const FilterState& state, ImageMemory& memory, int camera);
  void list_due();
  void gather(const FilterState& state, std::uint32_t track, int first_age, int last_age);

  int longest_;  ///< Views of one landmark: each camera has its share of the window.
  LandmarkUpdate update_;
  std::vector<Seen> images_;  ///< Of one camera, oldest first.
  struct Due {
    std::uint32_t track;
    int first_age;
    int last_age;
  };
  std::vector<Due> due_;
  std::vector<LandmarkView> views_;
};

}  // namespace fiducap::world
