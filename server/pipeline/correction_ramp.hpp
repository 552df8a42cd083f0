#pragma once

#include <Eigen/Core>

#include "base/pose.hpp"
#include "base/time.hpp"
#include "estimation/body_estimate.hpp"

namespace fiducap {

/// How corrections of the map reach clients.
struct RampConfig {
  double seconds{0.0};  ///< That a correction takes; 0: all is published at once.
  /// Between two published frames: within it no pose moves by a sigma. Not less than the slowest
  /// client's.
  double frame_s{1.0 / 30};
  /// Images move bodies by what the map had learned, too. False: no graph makes it learn, and only
  /// an operator moves it.
  bool follows_images{true};
};

/// What of the map's corrections (UpdateReport::map_shift) is not published yet, and of images that
/// moved the body by what the map had learned.
///
/// A published pose is the filter's with this rest on top. The rest is kept about the body: a
/// difference of place in W axes, and a rotation vector in W axes on the left of the attitude. A
/// pose on the left of X_WB would move a body that drives on by its turn about an origin far away.
///
/// Over time the rest is a cubic that ends at zero at rest; it goes on with the value and speed it
/// has when the next correction comes, however many come (C1). No frame may move by more than a
/// sigma. Let x be the share of the time that is left. At the end the cubic is (1 + a) x² of the
/// rest, a = 2 from standing, 0 when it goes already; and what is left is in the published sigma,
/// so only where it is less than the filter's sigma can a frame be too much. Putting one into the
/// other, half a sigma per frame is kept when the ramp takes 5.26 · frame · sqrt((1 + a) rest /
/// sigma), so much time it gets: beyond 43 sigmas, with the defaults, more than it is configured.
/// Speed that does not lead to zero (a correction back) is kept up to a quarter of a sigma per
/// frame. With every image the rest is planned anew from where it is: as long as sigma does not
/// shrink, that is the same cubic.
///
/// Velocity and rates stay the filter's: the motion in the room, without the few millimetres per
/// second by which the published place creeps meanwhile.
///
/// O(1), allocates nothing. Not thread-safe.
class CorrectionRamp final {
 public:
  explicit CorrectionRamp(const RampConfig& config) : config_(config) {}

  /// The map has moved the body: that takes the time of the configuration. @pre is_on()
  /// @param shown  X_WB as it was published for `from`   @param now  the filter's at that instant
  /// @param from   the newest instant that may have been published
  void correct(const Pose& shown, const BodyEstimate& now, Instant from);
  /// An image has. More than a quarter of a sigma takes as long as it has to, less is published at
  /// once. @pre is_on()
  void follow(const Pose& shown, const BodyEstimate& now, Instant from);
  /// The poses before have nothing to do with those that come.
  void forget() { seconds_ = 0; }

  [[nodiscard]] bool is_on() const { return config_.seconds > 0; }
  /// Whether an image, after which the map has moved the body or not, is bridged at all.
  [[nodiscard]] bool bridges(bool map_has_moved, Instant from) const {
    return is_on() && (config_.follows_images || map_has_moved || !is_over(from));
  }
  [[nodiscard]] bool is_over(Instant at) const;
  /// Puts what is left on top: pose, and covariance. Nothing after the end.
  void apply(Instant at, BodyEstimate& shown) const;

  /// What is left of one part, and how it changes.
  struct Part {
    Eigen::Vector3d rest{Eigen::Vector3d::Zero()};   ///< m or rad, W axes.
    Eigen::Vector3d speed{Eigen::Vector3d::Zero()};  ///< Per second.
  };

 private:
  /// Of place and attitude.
  struct Rest {
    Part place;
    Part turn;
  };
  [[nodiscard]] Rest at(Instant at) const;
  void plan(Rest rest, double seconds, const BodyEstimate& now, Instant from);

  RampConfig config_;
  Instant begun_at_{};
  double seconds_{0};  ///< 0: there is none.
  Rest begin_;         ///< At begun_at_.
};

}  // namespace fiducap
