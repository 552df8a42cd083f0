#pragma once

#include <map>
#include <memory>
#include <span>
#include <vector>

#include "base/pose.hpp"
#include "estimation/body_estimate.hpp"
#include "estimation/known_tag.hpp"
#include "estimation/segment/motion_segment.hpp"
#include "mapping/tag_map.hpp"

namespace fiducap {

/// Tags of the map that contradict the images of one body.
///
/// Its filter has given such a tag up, and estimates it again as a local tag. Whether the tag was
/// moved is decided by the map, which needs several reports (TagWatch). Until then the tag is left
/// out of what the filter gets from the map: it would give it up again and again. It is used again
/// when the body's own estimate agrees with the map, when the map has another place for it, or when
/// the body was lost, so that its images were wrong.
class ContradictedTags final {
 public:
  /// Removes these tags from `known`, which are the map's tags in an image.
  /// @return the map without them
  const KnownMap* use(const TagMap& map, std::vector<KnownTag>& known);
  /// The filter has rejected the map's place of a tag.
  void add(const TagMap& map, int tag_id);
  [[nodiscard]] bool contains(int tag_id) const { return tags_.contains(tag_id); }
  /// The body was lost.
  void forget_all();
  /// Compares the body's own estimates with the map.
  /// @param out  gets the tags that have contradicted the map again, in as many images as it takes
  ///             a filter to reject a tag
  void compare(std::span<const TagBelief> beliefs, std::vector<int>& out);
  /// The segment without these tags, which have other places in the map.
  [[nodiscard]] std::shared_ptr<const MotionSegment> without(
      std::shared_ptr<const MotionSegment> segment) const;

 private:
  struct Tag {
    KnownTag in_map;
    int reported{};  ///< Sightings of the body's own estimate until the last report.
  };
  void forget_changed(const TagMap& map);

  std::map<int, Tag> tags_;
  std::shared_ptr<const KnownMap> base_;  ///< The map's …
  std::shared_ptr<const KnownMap> rest_;  ///< … and without these tags; nullptr: to be made.
  std::uint64_t returned_{0};             ///< How often tags are used again: filters adopt them.
};

}  // namespace fiducap
