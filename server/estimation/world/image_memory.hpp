#pragma once

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "detection/tag_observation.hpp"
#include "estimation/known_tag.hpp"
#include "estimation/world/filter_state.hpp"

namespace fiducap::world {

/// The newest images, and the filter's states at the first sightings of undecided tags.
///
/// A tag waits until its pose branch is certain. Then the filter returns to its first sighting,
/// adds the tag there and processes the images since again, so that no sighting is lost. Bounded in
/// images, time (kFilterPast) and states; reuses its memory.
class ImageMemory final {
 public:
  struct Admission {
    int tag_id{};
    Pose X_VT;  ///< In the camera's axes of that image: linearisation point.
  };
  struct Image {
    TagObservations seen;
    std::vector<KnownTag> known;
    std::vector<Admission> admissions;  ///< Tags that joined with this image, now or later.
  };
  /// First sighting of a waiting tag.
  struct FirstSight {
    int tag_id{};
    long number{};              ///< of the image
    Eigen::Quaterniond q_LV{};  ///< Camera attitude in the axes for comparing views.
  };

  void forget_all();
  /// Removes the tag from all images and states.
  void forget_tag(int tag_id);
  /// Adds the present image; drops the oldest images and their states.
  void add(const TagObservations& seen, std::span<const KnownTag> known);
  [[nodiscard]] long newest() const { return newest_; }
  /// Whether the image is remembered.
  [[nodiscard]] bool has(long number) const {
    return number >= 0 && number <= newest_ && number > newest_ - kImages;
  }
  [[nodiscard]] Image& image(long number) { return images_[slot(number)]; }

  /// A tag waits since the present image, with this state before any admission. No effect when the
  /// tag waits already or when the memory is full.
  void wait(int tag_id, const Eigen::Quaterniond& q_LV, const FilterState& state);
  void stop_waiting(int tag_id);
  [[nodiscard]] std::optional<FirstSight> first_sight(int tag_id) const;
  /// The state at an image since which a tag waits, or nullptr.
  [[nodiscard]] const FilterState* state_at(long number) const;
  /// Replaces that state after images were processed again.
  void renew(long number, const FilterState& state);
  /// Moves the states to other workspace axes.
  void move_axes(const Pose& G);
  /// Start of the IMU samples still needed.
  [[nodiscard]] std::optional<Instant> needed_since() const;

 private:
  static constexpr long kImages = 40;        ///< 2 s at 20 Hz.
  static constexpr std::size_t kStates = 6;  ///< A state may have megabytes.

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
