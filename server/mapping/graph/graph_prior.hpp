#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "estimation/known_tag.hpp"
#include "estimation/segment/motion_segment.hpp"

namespace fiducap {

/// What is known of tags and cameras beside the segments: by a survey, by a stored map, by segments
/// that were given up. The joint distribution as a product, each tag given a few of those before
/// it:
///
///     e_tag = A e_on + C e_cameras + rest,   e: plain errors (KnownTag) against `expected`
///
/// A common shift and yaw of all tags costs nothing, unless a survey says where they are.
struct GraphPrior {
  struct Hanging {
    std::size_t tag{};            ///< Index in `tags`.
    std::vector<std::size_t> on;  ///< Likewise; all of them come before it.
    Eigen::MatrixXd A;            ///< 6 x 6 |on|
    Eigen::MatrixXd C;            ///< 6 x cameras' numbers; none: 6 x 0
    Matrix6d information;         ///< Of the rest.
  };

  std::vector<std::size_t> tags;  ///< Index in GraphState::tags of each.
  std::vector<Pose> expected;
  std::vector<Hanging> hangings;
  bool is_absolute{false};  ///< Something says where W is: a survey, or a tag that is held.

  std::vector<std::vector<CameraBelief>> cameras;  ///< Of the first bodies, in their order …
  Eigen::MatrixXd camera_information;              ///< … in place of GraphBody::information.

  /// W is moved: X ← T X for all tags.
  void move(const Pose& T);
  /// This tag stands there by definition, and says where W is: its place and the heading of its
  /// most level axis (HeadingRule); when gravity does not say what is up, all of its attitude.
  void hold(std::size_t tag, const Pose& X_WT, bool level);
  /// Tags have other indices now.
  void renumber(const std::vector<std::size_t>& now);
};

/// One tag of those that a prior is made of.
struct PriorTag {
  std::size_t tag{};  ///< Index in GraphState::tags.
  Pose X_WT;
  Matrix6d covariance;  ///< Plain, as KnownTag's.
  bool is_surveyed{};   ///< The covariance is against W, and nothing else is known of it.
};

/// How the errors of two tags hang together, plain; nullopt: not known.
using PriorBetween = std::function<std::optional<Matrix6d>(std::size_t a, std::size_t b)>;

/// Cameras whose errors hang together with those of the tags.
struct PriorCameras {
  std::vector<std::vector<CameraBelief>> bodies;
  Eigen::MatrixXd covariance;            ///< Of all their numbers.
  std::vector<Eigen::MatrixXd> of_tags;  ///< Per tag: 6 x numbers, plain.
};

/// What the covariances do not say, whatever their numbers.
enum class PriorUnknown {
  kNothing,       ///< They are against W, by a survey.
  kPlaceAndYaw,   ///< Of all of it.
  kPlaceAndTurn,  ///< No gravity is felt.
};

/// @param between  asked with indices in `tags`
[[nodiscard]] GraphPrior make_prior(std::span<const PriorTag> tags, const PriorBetween& between,
                                    const PriorCameras& cameras, PriorUnknown unknown);

}  // namespace fiducap
