#pragma once

#include <optional>
#include <string>

#include <Eigen/Core>

#include "base/pose.hpp"
#include "base/time.hpp"
#include "estimation/body_estimate.hpp"

/// How corrections of the map reach clients and the user.
namespace fiducap {

struct RampConfig {
  double seconds{0.0};  ///< Duration of a correction; 0: published at once.
  /// Frame period of the slowest client: within it no pose moves by more than a sigma.
  double frame_s{1.0 / 30};
};

/// The part of the map's corrections (UpdateReport::map_shift) that is not published yet; also of
/// images that moved the body by what the map had learned.
///
/// published pose = filter's pose + rest. The rest is kept at the body: a difference of positions
/// and a rotation vector left of the attitude, both in W axes. (A pose left of X_WB would move a
/// driving body by its rotation about a distant origin.)
///
/// Over time the rest is a cubic that ends at zero with zero speed; a new correction continues from
/// its value and speed (C1). No frame may move by more than a sigma: with x the remaining share of
/// time, the end of the cubic is (1 + a) x² of the rest, where a = 2 from standstill and 0 when it
/// moves already. The rest is part of the published sigma, so only where it is less than the
/// filter's sigma can a frame move too far. Both together limit a frame to half a sigma when the
/// ramp takes 5.26 · frame · sqrt((1 + a) rest / sigma): more than the configured time beyond
/// 43 sigmas with the defaults. Speed that does not lead to zero is limited to a quarter of a sigma
/// per frame. Every image plans the rest again; while sigma does not shrink, that is the same
/// cubic.
///
/// Velocity and rates stay the filter's.
///
/// O(1), allocates nothing. Not thread-safe.
class CorrectionRamp final {
 public:
  explicit CorrectionRamp(const RampConfig& config) : config_(config) {}

  /// The map has moved the body: takes the configured time. @pre is_on()
  /// @param shown  X_WB as published for `from`   @param now  the filter's at that instant
  /// @param from   newest instant that may have been published
  void correct(const Pose& shown, const BodyEstimate& now, Instant from);
  /// An image has moved the body: more than a quarter of a sigma takes the time it needs, less is
  /// published at once. @pre is_on()
  void follow(const Pose& shown, const BodyEstimate& now, Instant from);
  /// Drops the rest: the next poses are unrelated to those before.
  void forget() { seconds_ = 0; }

  [[nodiscard]] bool is_on() const { return config_.seconds > 0; }
  [[nodiscard]] bool is_over(Instant at) const;
  /// Adds the rest to pose and covariance.
  void apply(Instant at, BodyEstimate& shown) const;

  struct Part {
    Eigen::Vector3d rest{Eigen::Vector3d::Zero()};   ///< m or rad, W axes.
    Eigen::Vector3d speed{Eigen::Vector3d::Zero()};  ///< Per second.
  };

 private:
  struct Rest {
    Part place;
    Part turn;
  };
  [[nodiscard]] Rest at(Instant at) const;
  void plan(Rest rest, double seconds, const BodyEstimate& now, Instant from);

  RampConfig config_;
  Instant begun_at_{};
  double seconds_{0};  ///< 0: no ramp.
  Rest begin_;         ///< At begun_at_.
};

/// Reports when the map has moved a body by a centimetre or half a degree, and by more than its
/// sigma. Smaller corrections add up.
class MapCorrections final {
 public:
  /// @return a new message; usually empty
  [[nodiscard]] std::string add(const UpdateReport& report,
                                const std::optional<BodyEstimate>& estimate);

 private:
  int generation_{};
  Eigen::Vector3d place_{Eigen::Vector3d::Zero()};  ///< At the body, W axes, not reported yet.
  Eigen::Vector3d turn_{Eigen::Vector3d::Zero()};
};

}  // namespace fiducap
