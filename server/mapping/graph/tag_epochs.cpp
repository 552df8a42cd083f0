// TagEpochs: which place of its tag a sighting belongs to.
#include <algorithm>

#include "detection/tag_geometry.hpp"
#include "mapping/graph/map_graph.hpp"

namespace fiducap {

namespace {

/// Mean offset of the seen from the expected corners, in edges.
double distance_off(const MotionSegment& segment, const MotionSegment::Instance& instance,
                    const SegmentImage& image, const TagObservation& seen, const KnownTag& tag) {
  const auto c = static_cast<std::size_t>(image.camera);
  const Pose X_VT = (instance.body.X_WB * segment.cameras[c].X_BV).inverse() * tag.X_WT;
  Eigen::Vector2d off = Eigen::Vector2d::Zero();
  for (int i = 0; i < 4; ++i) {
    const Eigen::Vector3d p_VC = X_VT * tag_corner(i, tag.edge_m);
    if (p_VC.z() <= 0) return 1;
    const Eigen::Vector2d expected = segment.sensors->cameras[c].model.pinhole(p_VC);
    off += (seen.corners_px[static_cast<std::size_t>(i)] - expected) / 4;
  }
  return off.norm() / (seen.corners_px[1] - seen.corners_px[0]).norm();
}

}  // namespace

void TagEpochs::follow(const EpochOrder& order) {
  if (order.opens) {
    epochs_[order.tag_id].push_back(*order.opens);
  } else if (const auto found = epochs_.find(order.tag_id); found != epochs_.end()) {
    found->second.pop_back();
    if (found->second.empty()) epochs_.erase(found);
  }
}

int TagEpochs::newest(int tag_id) const {
  const auto found = epochs_.find(tag_id);
  return found == epochs_.end() ? 0 : static_cast<int>(found->second.size());
}

std::optional<int> TagEpochs::at(int tag_id, Instant seen_at) const {
  const auto found = epochs_.find(tag_id);
  if (found == epochs_.end()) return 0;
  const std::vector<TagEpoch>& epochs = found->second;
  for (std::size_t i = epochs.size(); i-- > 0;) {
    if (seen_at > epochs[i].back) return static_cast<int>(i) + 1;
    if (seen_at > epochs[i].gone) return std::nullopt;
  }
  return 0;
}

std::vector<int> TagEpochs::sort(MotionSegment& segment) const {
  // Offset of a sighting, in edges, from which it is not where the segment has its tag: the body's
  // filter had not rejected the former place yet.
  constexpr double kElsewhere = 0.25;
  std::map<int, int> place;  // by tag id
  if (!epochs_.empty()) {
    for (const MotionSegment::Instance& instance : segment.instances)
      for (const SegmentImage& image : instance.images)
        for (const SegmentSighting& one : image.tags)
          place[one.seen.tag_id] =
              std::max(place[one.seen.tag_id], at(one.seen.tag_id, instance.body.at).value_or(0));
    remove_sightings(segment, [&](const auto& instance, const auto& image, const auto& one) {
      const int tag_id = one.seen.tag_id;
      if (at(tag_id, instance.body.at) != place.at(tag_id)) return true;
      if (place.at(tag_id) == 0) return false;
      const KnownTag& tag = *std::ranges::find(segment.tags, tag_id, &KnownTag::tag_id);
      return distance_off(segment, instance, image, one.seen, tag) > kElsewhere;
    });
  }
  std::vector<int> epochs;
  for (const KnownTag& tag : segment.tags) epochs.push_back(place[tag.tag_id]);
  return epochs;
}

}  // namespace fiducap
