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

/// Joint prior of tags and cameras: from a survey, a stored map or folded segments. A product of
/// conditional distributions, each tag given a few of those before it:
///
///     e_tag = A e_given + C e_cameras + rest,   e: plain errors (KnownTag) against `expected`
///
/// A common shift and yaw of all tags costs nothing, unless a survey fixes them.
struct GraphPrior {
  struct Conditional {
    std::size_t tag{};               ///< Index in `tags`.
    std::vector<std::size_t> given;  ///< Likewise; all of them come before it.
    Eigen::MatrixXd A;               ///< 6 x 6 |given|
    Eigen::MatrixXd C;               ///< 6 x cameras' parameters; none: 6 x 0
    Matrix6d information;            ///< Of the rest.
  };

  std::vector<std::size_t> tags;  ///< Index in GraphState::tags of each.
  std::vector<Pose> expected;
  std::vector<Conditional> conditionals;
  bool is_absolute{false};  ///< W is fixed: by a survey, or by a tag that is held.

  std::vector<std::vector<CameraBelief>> cameras;  ///< Of the first bodies, in their order …
  Eigen::MatrixXd camera_information;              ///< … in place of GraphBody::information.

  /// W is moved: X ← T X for all tags.
  void move(const Pose& T);
  /// Fixes W by this tag: its place and the heading of its most level axis (HeadingRule); when the
  /// vertical is not known, all of its attitude.
  void hold(std::size_t tag, const Pose& X_WT, bool level);
  /// @param now  new index of each tag
  void renumber(const std::vector<std::size_t>& now);
};

struct PriorTag {
  std::size_t tag{};  ///< Index in GraphState::tags.
  Pose X_WT;
  Matrix6d covariance;  ///< Plain, as KnownTag's.
  bool is_surveyed{};   ///< The covariance is against W, and there is no other information.
};

/// Covariance of the errors of two tags, plain; nullopt: not known.
using PriorBetween = std::function<std::optional<Matrix6d>(std::size_t a, std::size_t b)>;

/// Cameras whose errors are correlated with those of the tags.
struct PriorCameras {
  std::vector<std::vector<CameraBelief>> bodies;
  Eigen::MatrixXd covariance;            ///< Of all their parameters.
  std::vector<Eigen::MatrixXd> of_tags;  ///< Per tag: 6 x parameters, plain.
};

/// The gauge: what the covariances do not determine.
enum class PriorUnknown {
  kNothing,       ///< They are against W, by a survey.
  kPlaceAndYaw,   ///< Of the whole.
  kPlaceAndTurn,  ///< The vertical is not known either.
};

/// @param between  called with indices in `tags`
[[nodiscard]] GraphPrior make_prior(std::span<const PriorTag> tags, const PriorBetween& between,
                                    const PriorCameras& cameras, PriorUnknown unknown);

}  // namespace fiducap
