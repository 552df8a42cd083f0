#pragma once

#include <array>
#include <optional>

#include "estimation/segment/motion_segment.hpp"
#include "estimation/segment/segment_smoother.hpp"
#include "estimation/world/filter_state.hpp"

namespace fiducap {

/// A segment without noise: the true path is what its own readings make of its beginning, step by
/// step, and every corner is where that path's camera sees it. It begins at the origin.
class ExampleSegment {
 public:
  struct Setup {
    bool has_imu{true};
    int cameras{1};
    int images{12};  ///< Of each camera.
    double image_period_s{0.05};
    double camera_lag_s{0.001};  ///< Of the second camera's images behind the first one's.
    double step_s{0.005};
    double shift_s{0};  ///< Of the clocks, of which nothing is in the stamps.
    double readout_s{0};
    double jitter_s{0};
    LensOffset lens{};
    double scale{0};  ///< Of all prints, against the configuration.
    bool is_even{true};
    double gravity_more_m_s2{0};  ///< It is more than the sensors say.
  };

  explicit ExampleSegment(const Setup& setup);

  /// What condense() makes of it; the segment stays as it is.
  [[nodiscard]] std::optional<SegmentFactor> condensed() const;

  MotionSegment segment;

 private:
  void add_camera(int c);
  [[nodiscard]] BodyMoment moment() const;
  [[nodiscard]] InertialInput input(double t_s) const;
  void go_to(double t_s);
  void hang_tag(int tag_id);
  /// Where the camera is when its first, its middle and its last row are exposed.
  [[nodiscard]] std::array<Pose, 3> rows(std::size_t instance, int camera) const;
  [[nodiscard]] std::optional<SegmentSighting> sight(const KnownTag& tag,
                                                     const std::array<Pose, 3>& X_WV) const;

  Setup setup_;
  world::FilterState state_;
  double t_s_{0};
};

/// All boundary values of a segment are moved, in the order of segment_layout.
[[nodiscard]] MotionSegment moved(MotionSegment segment, const Eigen::VectorXd& error);

/// The room is moved under it.
[[nodiscard]] MotionSegment in_other_axes(const Pose& G, MotionSegment segment);

}  // namespace fiducap
