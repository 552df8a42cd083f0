#pragma once

#include <map>
#include <optional>
#include <vector>

#include "estimation/segment/motion_segment.hpp"

namespace fiducap {

/// A tag has left its place: sightings after `gone` are not of that place any more, those after
/// `back` are of the next one. Between the two nobody knew; they are of none.
struct TagEpoch {
  Instant gone{};
  Instant back{};  ///< Instant::max(): the tag is not used any more.
};

/// What the map says of a tag's places. In order.
struct EpochOrder {
  int tag_id{};
  std::optional<TagEpoch> opens{};  ///< nullopt: the newest place is the one before, after all.
};

/// Which place of its tag each sighting is of. A tag that was moved is another one from then on:
/// (id, epoch), epochs counted from 0.
class TagEpochs final {
 public:
  void follow(const EpochOrder& order);
  [[nodiscard]] int newest(int tag_id) const;
  /// nullopt: of none.
  [[nodiscard]] std::optional<int> at(int tag_id, Instant seen_at) const;
  /// A segment has one place for each tag. Takes out sightings of none and, where a tag was moved
  /// meanwhile, of all but the newest place; and what is left of a tag that is not where the
  /// segment has it: its body had not yet noticed.
  /// @return the epoch of each tag that is left
  std::vector<int> sort(MotionSegment& segment) const;

 private:
  [[nodiscard]] int sort(MotionSegment& segment, const KnownTag& tag) const;

  std::map<int, std::vector<TagEpoch>> epochs_;  ///< By tag id, the first one's left out.
};

}  // namespace fiducap
