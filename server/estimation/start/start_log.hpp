#pragma once

#include <span>
#include <vector>

#include "capture/imu_sample.hpp"
#include "detection/tag_observation.hpp"
#include "estimation/known_tag.hpp"

namespace fiducap {

/// All that went into a filter since its first tag, and a second before: as long as it may have to
/// start again with another clock. Bounded in time, readings, images and sightings.
class StartLog final {
 public:
  struct Image {
    TagObservations seen;
    std::vector<KnownTag> known;
    bool may_define_workspace{};
  };

  void add(const ImuSample& imu);
  /// Images before the first tag are not kept.
  void add(const TagObservations& seen, const MapKnowledge& map);
  /// More came in, or for longer, than a start is worth: nothing is added any more.
  [[nodiscard]] bool is_full() const;
  /// 0 before the first tag.
  [[nodiscard]] double seconds_since_first_tag(Instant now) const;
  [[nodiscard]] const std::vector<ImuSample>& imu() const { return imu_; }
  [[nodiscard]] const std::vector<Image>& images() const { return images_; }

 private:
  std::vector<ImuSample> imu_;
  std::vector<Image> images_;
  std::size_t sightings_{0};
};

}  // namespace fiducap
