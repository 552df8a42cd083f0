#pragma once

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "detection/tag_observation.hpp"
#include "estimation/known_tag.hpp"
#include "estimation/world/filter_state.hpp"

namespace fiducap::world {

/// The newest images, and what the filter knew when a tag that is still being judged was first
/// seen.
///
/// A tag waits until its pose branch is certain. Its sightings meanwhile are not lost: once the
/// branch is decided, the filter goes back to the first of them, lets the tag join there, and
/// follows the images since once more. Bounded by images, by time (kFilterPast: IMU readings are
/// kept for no longer) and by states; memory is kept and reused.
class ImageMemory final {
 public:
  struct Admission {
    int tag_id{};
    /// In the camera's axes of that image, near the truth by all that is known: the corners are
    /// linearised here.
    Pose X_VT;
  };
  struct Image {
    TagObservations seen;
    std::vector<KnownTag> known;
    std::vector<Admission> admissions;  ///< Tags that joined with this image, now or later.
  };
  /// Where a waiting tag was first seen.
  struct FirstSight {
    int tag_id{};
    long number{};              ///< of the image
    Eigen::Quaterniond q_LV{};  ///< Camera attitude then, in the axes in which views are compared.
  };

  void forget_all();
  /// The tag is no more what it was: no past in which it plays a part.
  void forget_tag(int tag_id);
  /// Takes in the present image. Oldest images and what hangs on them fall out.
  void add(const TagObservations& seen, std::span<const KnownTag> known);
  [[nodiscard]] long newest() const { return newest_; }
  /// Whether this image is still there.
  [[nodiscard]] bool has(long number) const {
    return number >= 0 && number <= newest_ && number > newest_ - kImages;
  }
  [[nodiscard]] Image& image(long number) { return images_[slot(number)]; }

  /// Notes that a tag waits since the present image, whose state this is (before any admission). No
  /// effect when the tag waits already, or when too many do.
  void wait(int tag_id, const Eigen::Quaterniond& q_LV, const FilterState& state);
  void stop_waiting(int tag_id);
  [[nodiscard]] std::optional<FirstSight> first_sight(int tag_id) const;
  /// The state at an image at which some tag began to wait, or nullptr.
  [[nodiscard]] const FilterState* state_at(long number) const;
  /// Replaces that state, when the past was followed again.
  void renew(long number, const FilterState& state);
  /// The workspace axes were moved by G: the states go along.
  void move_axes(const Pose& G);
  /// IMU readings are needed from here on.
  [[nodiscard]] std::optional<Instant> needed_since() const;

 private:
  static constexpr long kImages = 40;        ///< 2 s at 20 Hz: most tags are decided long before.
  static constexpr std::size_t kStates = 6;  ///< A state may weigh megabytes.

  struct Checkpoint {
    long number{-1};  ///< -1: free
    FilterState state;
  };

  [[nodiscard]] static std::size_t slot(long number) {
    return static_cast<std::size_t>(number % kImages);
  }
  void free_unneeded();

  std::array<Image, kImages> images_;
  long newest_{-1};
  std::vector<FirstSight> waiting_;
  std::array<Checkpoint, kStates> checkpoints_;
};

}  // namespace fiducap::world
