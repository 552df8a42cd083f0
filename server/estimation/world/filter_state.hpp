#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "base/pose.hpp"
#include "base/time.hpp"
#include "estimation/body_estimate.hpp"
#include "estimation/filter/growing_covariance.hpp"
#include "estimation/filter/tag_record.hpp"
#include "estimation/world/pose_error.hpp"
#include "estimation/world/sensor_errors.hpp"
#include "estimation/world/state_layout.hpp"

namespace fiducap::world {

/// A tag in the state. It stands still in W.
struct WorldTag : TagRecord {
  Pose X_WT;
  /// Its place is the map's, with the map's covariance: used, correlated, but not corrected
  /// (consider state, Schmidt 1966).
  bool held{false};
};

/// A camera as it stood at an image, for what followed points say (clone_window.hpp). A pose with a
/// world-side error, like a tag.
struct Clone {
  Pose X_WV;
  int camera{};
  long image{-1};  ///< Number of the image in ImageMemory; -1: nothing yet.
};

/// The state with its covariance: body, biases, extrinsics, clocks, gravity, clones, tags, all in
/// W. Gravity along −z when there is an IMU.
struct FilterState {
  Instant time{};
  Pose X_WB;
  Eigen::Vector3d v_WB{Eigen::Vector3d::Zero()};
  Eigen::Vector3d bias_f{Eigen::Vector3d::Zero()};
  Eigen::Vector3d bias_w{Eigen::Vector3d::Zero()};
  std::vector<Pose> X_BV;           ///< One per camera.
  std::vector<CameraClock> clocks;  ///< One per camera.
  std::vector<LensOffset> lenses;   ///< One per camera.
  PrintSizes sizes;
  double gravity_offset_m_s2{};          ///< Gravity minus the configured value.
  std::vector<Suspicion> suspicions;     ///< Per suspect; empty: nothing is doubted.
  Instant judged_until{Instant::min()};  ///< Whoever makes the map opens suspects, nobody else.
  /// A fixed number of them (none: points are not followed), in no order.
  std::vector<Clone> clones;
  std::vector<WorldTag> tags;  ///< Order of entry.
  /// How the body moves just now; not estimated, from the last inertial step.
  Eigen::Vector3d gyro_B{Eigen::Vector3d::Zero()};  ///< bias still in
  Eigen::Vector3d a_WB{Eigen::Vector3d::Zero()};
  GrowingCovariance covariance;

  [[nodiscard]] int cameras() const { return static_cast<int>(X_BV.size()); }
  [[nodiscard]] int size() const { return tag_at(tags.size()); }
  [[nodiscard]] Pose X_WV(int camera) const {
    return X_WB * X_BV[static_cast<std::size_t>(camera)];
  }
  /// Where the body is `seconds` later (or earlier), as it moves now: a few milliseconds.
  [[nodiscard]] Pose X_WB_after(double seconds) const;
  [[nodiscard]] int tag_at(std::size_t i) const {
    return layout::tag(cameras(), static_cast<int>(clones.size() + i));
  }
  [[nodiscard]] int clone_at(std::size_t i) const {
    return layout::tag(cameras(), static_cast<int>(i));
  }
  /// size() × size(), symmetric.
  [[nodiscard]] auto P() { return covariance.live(); }
  [[nodiscard]] auto P() const { return covariance.live(); }
  /// Whether something about a camera's clock is estimated.
  [[nodiscard]] bool clock_is_open(int camera) const {
    return P().diagonal().segment<2>(layout::clock(camera)).maxCoeff() > 0;
  }
  /// Index of a tag in `tags`, or -1.
  [[nodiscard]] int find(int tag_id) const { return find_tag(tags, tag_id); }
  /// Whether what the configuration says of lens, readout and prints is doubted at all.
  [[nodiscard]] bool has_suspects() const { return !suspicions.empty(); }
  /// Column of the tag's own print size, or -1.
  [[nodiscard]] int print_at(int tag_id) const {
    const int watched = sizes.find(tag_id);
    return watched < 0 ? -1 : layout::print(cameras(), watched);
  }
  /// Nothing is known of this column, and nothing hangs on it.
  void clear_column(int at, double sigma);
  /// First columns of the six numbers each that are used and not corrected: of held tags …
  [[nodiscard]] std::span<const int> held_tags() const { return held_; }
  /// … and of what is held besides, until release_blocks(), or until a tag comes or goes.
  void hold_block(int at) { held_.push_back(at); }
  void release_blocks() { list_held(); }

  /// Body at the origin, biases, clocks and covariance zero, these cameras, no tags, so many
  /// clones.
  void reset(std::vector<Pose> X_BV, std::size_t clones = 0);
  /// What the clones saw is not used any more.
  void forget_clones();
  /// Appends a tag, uncorrelated with everything.
  void add_tag(const WorldTag& tag, const Matrix6d& own);
  /// Takes tags out (marginalises them). @param numbers  ascending
  void remove_tags(std::span<const std::size_t> numbers);
  /// The tag is the map's from now on, and stands there; not the covariance.
  void hand_over(std::size_t i, const Pose& X_WT);
  void remove_tag(std::size_t i) { remove_tags({&i, 1}); }
  /// All but the covariance.
  void copy_mean(const FilterState& other);
  /// x ⊞ ξ, an error vector of length size() in the coordinates of state_layout.hpp.
  void add_error(const Eigen::Ref<const Eigen::VectorXd>& error);
  /// The error that leads from this state's mean to `other`'s (same tags): other = this ⊞ ξ.
  [[nodiscard]] Eigen::VectorXd error_to(const FilterState& other) const;

 private:
  void list_held();
  std::vector<int> held_;
  std::vector<int> columns_;  ///< Memory of remove_tags().
};

/// The covariance while the body moves on its own: the blocks of the cameras hold, instead of the
/// error of X_WV, that of X_BV = Exp(e) X̂_BV, which does not change then. @pre the other form
void camera_errors_to_extrinsics(FilterState& state);
/// … and back, with the body where it is now.
void extrinsics_to_camera_errors(FilterState& state);

/// Pose, velocity and biases with their covariance; rate, acceleration and `anchored` are left
/// alone.
[[nodiscard]] BodyEstimate body_in_workspace(const FilterState& state);
/// The covariance goes along when an update with an image of `camera` has moved the mean by
/// `correction` (add_error).
///
/// What images said so far is about lever arms as they were then: seen from a camera, the place of
/// a tag is off by ρ_T − ρ_V + (φ_T − φ_V) × p_T. Corrections move p_T, above all along the line of
/// sight of a tag just met. With ρ_T left alone that expression would change its meaning, and the
/// tilt of the tag against the camera, (φ_T − φ_V), seem known from the difference. So ρ_T gives
/// way. Body and other cameras likewise. (The point form of the right-invariant error does this by
/// itself, at the price of an IMU step that touches every tag.)
void transport_covariance(FilterState& state, const Eigen::Ref<const Eigen::VectorXd>& correction,
                          int camera);

/// Position (additive) and rotation vector of X_BV, both in B axes.
[[nodiscard]] Matrix6d extrinsics_covariance(const FilterState& state, int camera);
/// A tag with its covariance.
[[nodiscard]] KnownTag tag_in_workspace(const FilterState& state, std::size_t tag);

}  // namespace fiducap::world
