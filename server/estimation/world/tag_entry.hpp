#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "capture/lens/camera_model.hpp"
#include "detection/tag_observation.hpp"
#include "estimation/filter/corner_noise.hpp"
#include "estimation/known_tag.hpp"
#include "estimation/world/filter_state.hpp"

namespace fiducap::world {

/// Adds a new tag seen by `camera`, correlated with the camera, with covariance by its corners.
/// @param X_VT  approximate pose, in the certain one of its two branches: linearisation point
void augment(FilterState& state, int camera, const CameraModel& model, const TagObservation& seen,
             const Pose& X_VT, const CornerNoise& noise);

/// Fuses a surveyed pose of a tag in the state.
void fuse_prior(FilterState& state, std::size_t tag, const KnownTag& prior);

/// Adds a tag of the map, with its covariance, as a held tag.
void hold(FilterState& state, const KnownTag& known, Instant at);

/// Adds a held tag, correlated by `whole` when given. No effect when the tag is in the state or
/// exact.
void hold_one(FilterState& state, const KnownTag& tag, const KnownMap* whole, Instant at);

/// Replaces the tags of the state that are in the map, also own ones, by the map's joint mean and
/// covariance after a change of the map.
///
/// The filter knows p(body | tags), the map p(tags). The body follows its correlation with the
/// tags: no information is lost or counted twice, for any number of exchanges. The filter's
/// information about the pose of the whole workspace is dropped.
/// @param level  gravity defines the vertical: the common error is position and heading only
/// @return X_WnewWold of the body; nullopt: the map has no tag of the state
[[nodiscard]] std::optional<Pose> exchange(FilterState& state, const KnownMap& map, bool level);

/// Adds a held tag of the map, correlated with the map's tags in the state and so with the body.
void hold_beside(FilterState& state, const KnownTag& tag, const KnownMap& map, Instant at);

/// Joint covariance of several tags of a map, six numbers each as KnownTag::covariance. Pairs that
/// the map does not contain follow from intermediate tags.
[[nodiscard]] Eigen::MatrixXd joint_covariance(std::span<const KnownTag* const> tags,
                                               const KnownMap& map);

/// The map's tags in a filter's state, used and not corrected (Schmidt): those in view and the last
/// ones seen before.
class HeldTags final {
 public:
  /// The map has another revision than the last exchange.
  [[nodiscard]] bool has_changed(const KnownMap& map) const { return revision_ != map.revision; }
  /// See exchange(); once per revision of the map.
  std::optional<Pose> take_over(FilterState& state, const KnownMap& map, bool level);
  /// Adds and removes held tags by the map.
  /// @param whole  the map with correlations, or nullptr: tags are independent
  void follow(FilterState& state, const TagObservations& seen, std::span<const KnownTag> known,
              const KnownMap* whole, bool is_anchored);

 private:
  void forget(FilterState& state, const TagObservations& seen);

  std::optional<std::uint64_t> revision_;  ///< Of the last exchange.
  std::vector<std::size_t> out_of_view_;   ///< Scratch.
};

}  // namespace fiducap::world
