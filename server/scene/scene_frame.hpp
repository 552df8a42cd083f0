#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "base/time.hpp"
#include "estimation/body_estimate.hpp"
#include "mapping/tag_map.hpp"
#include "pipeline/body_pose.hpp"

namespace fiducap {

/// Properties of a body that frames do not repeat.
struct BodyDescription {
  int id{};          ///< Streaming id, 1..; stable.
  std::string name;  ///< As in the configuration.
};

/// The bodies in frames. Its generation changes when the list does.
struct SceneModel {
  std::uint64_t generation{1};
  std::vector<BodyDescription> bodies;
};

/// All bodies at one instant, and the map. Immutable once published, shared by all protocols. Its
/// axes W are those of the room, R, once an operator has aligned the map (RoomAxes).
struct SceneFrame {
  std::uint64_t number{};  ///< Counts up by 1 from the start of the server.
  Instant at{};            ///< Instant of the poses.
  Instant published_at{};  ///< When the frame was made.
  Duration utc_offset{};   ///< UTC = server time + utc_offset.
  double rate_hz{};
  /// Counts the alignments: frames with another number have other axes.
  std::uint64_t axes{};
  std::vector<BodyPose> bodies;  ///< Order of model->bodies.
  std::shared_ptr<const SceneModel> model;
  std::shared_ptr<const TagMap> map;

  [[nodiscard]] std::int64_t utc_ns() const { return to_ns(at) + utc_offset.count(); }
};

/// Transforms maps and poses from the workspace's axes W into the room's axes R, by the operator's
/// alignment X_RW of the map: its shift and heading only, as both have z up. Not thread-safe.
class RoomAxes final {
 public:
  /// Sets the map whose alignment is used. Copies each map once.
  /// @return the map with its tags in R and X_RW the identity; the same object where R is W
  [[nodiscard]] std::shared_ptr<const TagMap> set_map(std::shared_ptr<const TagMap> map);
  /// Counts changes of R: alignments and their roll-backs.
  [[nodiscard]] std::uint64_t number() const { return number_; }
  /// Transforms a pose of the last map. Allocates nothing.
  void transform(BodyPose& pose) const;

 private:
  std::shared_ptr<const TagMap> map_;          ///< As set.
  std::shared_ptr<const TagMap> map_in_room_;  ///< The same in R.
  bool is_workspace_{true};                    ///< R is W.
  Pose X_RW_;
  std::uint64_t number_{0};
  Eigen::Matrix3d R_RW_{Eigen::Matrix3d::Identity()};
};

/// How well the recent sightings of one tag fit, over all bodies.
struct TagFit {
  int tag_id{};
  /// Running root mean square of about the last 50 sightings, raw pixels: distance of the corners
  /// from those predicted after the filter's update with the image. Includes rejected sightings.
  double rms_px{};
  std::uint64_t sightings{};  ///< Since the server has started.
  Instant seen_at{};
};

/// Fits of all tags seen by bodies in the workspace. Thread-safe; allocates only for a new tag.
class TagFits final {
 public:
  static constexpr std::size_t kMostTags = 4096;  ///< Further ones are not listed.

  TagFits() { fits_.reserve(kMostTags); }
  void add(const UpdateReport& report);
  /// Sorted by id.
  [[nodiscard]] std::vector<TagFit> list() const {
    const std::lock_guard lock(mutex_);
    return fits_;
  }

 private:
  void add(const UpdateReport::CornerFit& fit, Instant seen_at);

  mutable std::mutex mutex_;
  std::vector<TagFit> fits_;
};

}  // namespace fiducap
