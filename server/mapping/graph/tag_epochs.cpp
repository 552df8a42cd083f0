// TagEpochs: which place of its tag a sighting belongs to.
#include <algorithm>
#include <set>

#include "base/numeric.hpp"
#include "detection/tag_geometry.hpp"
#include "mapping/graph/map_graph.hpp"

namespace fiducap {

namespace {

// Median offset, in edges, from which a tag is not where the segment has it.
constexpr double kElsewhere = 0.25;

template <class Work>
void for_sightings(MotionSegment& segment, int tag_id, const Work& work) {
  for (MotionSegment::Instance& instance : segment.instances) {
    for (SegmentImage& image : instance.images) {
      std::erase_if(image.tags, [&](const SegmentSighting& sighting) {
        return sighting.seen.tag_id == tag_id && !work(instance, image, sighting);
      });
    }
  }
}

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

bool is_seen_there(MotionSegment& segment, const KnownTag& tag) {
  std::vector<double> off;
  for_sightings(segment, tag.tag_id,
                [&](const auto& instance, const auto& image, const SegmentSighting& sighting) {
                  off.push_back(distance_off(segment, instance, image, sighting.seen, tag));
                  return true;
                });
  return !off.empty() && nth_smallest(off, off.size() / 2) < kElsewhere;
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

int TagEpochs::sort(MotionSegment& segment, const KnownTag& tag) const {
  int newest = 0;
  for_sightings(segment, tag.tag_id, [&](const auto& instance, const auto&, const auto&) {
    newest = std::max(newest, at(tag.tag_id, instance.body.at).value_or(0));
    return true;
  });
  for_sightings(segment, tag.tag_id, [&](const auto& instance, const auto&, const auto&) {
    return at(tag.tag_id, instance.body.at) == newest;
  });
  if (newest > 0 && !is_seen_there(segment, tag))
    for_sightings(segment, tag.tag_id, [](const auto&, const auto&, const auto&) { return false; });
  return newest;
}

std::vector<int> TagEpochs::sort(MotionSegment& segment) const {
  std::vector<int> epochs;
  std::vector<KnownTag> kept;
  std::set<int> seen;
  for (const KnownTag& tag : segment.tags)
    epochs.push_back(epochs_.contains(tag.tag_id) ? sort(segment, tag) : 0);
  if (epochs_.empty()) return epochs;
  for (MotionSegment::Instance& instance : segment.instances) {
    for (const SegmentImage& image : instance.images)
      for (const SegmentSighting& sighting : image.tags) seen.insert(sighting.seen.tag_id);
    std::erase_if(instance.images, [](const SegmentImage& image) { return image.tags.empty(); });
  }
  std::vector<int> kept_epochs;
  std::vector<double> kept_scales;
  segment.scales.resize(segment.tags.size());
  for (std::size_t i = 0; i < segment.tags.size(); ++i) {
    if (!seen.contains(segment.tags[i].tag_id)) continue;
    kept.push_back(segment.tags[i]);
    kept_scales.push_back(segment.scales[i]);
    kept_epochs.push_back(epochs[i]);
  }
  segment.tags = std::move(kept);
  segment.scales = std::move(kept_scales);
  return kept_epochs;
}

}  // namespace fiducap
