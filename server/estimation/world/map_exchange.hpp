#pragma once

#include <optional>
#include <span>

#include "estimation/known_map.hpp"
#include "estimation/world/filter_state.hpp"

namespace fiducap::world {

/// The map's tags in a filter's state, after the map has learned.
///
/// A filter knows where its body is against the tags, p(body | tags); where the tags are is the
/// map's to know, p(tags). So whatever tags of the state the map has, own ones too, get the map's
/// joint mean and covariance, and the body goes along as it hangs on them: nothing that the filter
/// learned through them is lost, nothing is counted twice, however often this happens. Where the
/// filter thought the room was (place and heading of all of it) does not count beside the map.
/// @param level  gravity says what is up: what is common to all is place and heading only
/// @return X_WnewWold of the body; nullopt: the map has no tag of the state
[[nodiscard]] std::optional<Pose> exchange(FilterState& state, const KnownMap& map, bool level);

/// A tag of the map joins, to be used and not corrected, with what its error shares with the tags
/// of the map that are in the state already, and through them with the body's.
void hold_beside(FilterState& state, const KnownTag& tag, const KnownMap& map, Instant at);

/// Covariance of several tags of a map, six numbers each as KnownTag::covariance. What the map does
/// not say of two tags follows from those between them.
[[nodiscard]] Eigen::MatrixXd joint_covariance(std::span<const KnownTag* const> tags,
                                               const KnownMap& map);

}  // namespace fiducap::world
