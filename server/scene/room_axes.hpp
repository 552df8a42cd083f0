#pragma once

#include <cstdint>
#include <memory>

#include "mapping/tag_map.hpp"
#include "pipeline/body_pose.hpp"

namespace fiducap {

/// Clients live in the room's axes R, everything else in the workspace's axes W: this is where one
/// becomes the other, by the map's X_RW (TagMap::X_RW, what an operator's alignment says). Both
/// have z up: of an X_RW that is tilted, as imported maps may have it, shift and heading count.
class RoomAxes final {
 public:
  /// @return the map with its tags in R, X_RW the identity: the same one where R is W. Copies a map
  /// once, not at every call.
  [[nodiscard]] std::shared_ptr<const TagMap> of(std::shared_ptr<const TagMap> map);
  /// Another one when R has become another: by an alignment, or when it was rolled back.
  [[nodiscard]] std::uint64_t number() const { return number_; }
  /// A pose that came with the last map, in R. Allocates nothing.
  void bring(BodyPose& pose) const;

 private:
  std::shared_ptr<const TagMap> map_;    ///< The last one …
  std::shared_ptr<const TagMap> moved_;  ///< … and what it is in R.
  bool is_workspace_{true};              ///< R is W.
  Pose X_RW_;
  std::uint64_t number_{0};
  Eigen::Matrix3d R_RW_{Eigen::Matrix3d::Identity()};
};

}  // namespace fiducap
