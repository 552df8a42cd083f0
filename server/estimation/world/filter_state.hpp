#pragma once

#include <Eigen/Core>
#include <array>
#include <span>
#include <vector>

#include "base/pose.hpp"
#include "base/time.hpp"
#include "capture/lens/camera_model.hpp"
#include "estimation/body_estimate.hpp"
#include "estimation/filter/growing_covariance.hpp"
#include "estimation/filter/tag_measurement.hpp"
#include "estimation/world/error_state.hpp"

namespace fiducap::world {

/// Exposure times of the rows of a camera's images.
struct CameraClock {
  double shift_s{};    ///< t_imu = stamp + shift of the middle row, beyond the configured shift.
  double readout_s{};  ///< First row to last row; 0: global shutter.
  double applied_s{};  ///< Part of the shift that is already in the stamp of the present image.
  /// Rolling shutter: each corner has its own time. False: an unexpected readout is modelled to
  /// first order.
  bool rows_apart{false};
  double jitter_s{};  ///< Independent error of each image's stamp, 1-sigma.

  /// From the state's instant to the exposure of a row. @param row  −0.5 first … +0.5 last
  [[nodiscard]] double seconds_to(double row) const {
    return shift_s - applied_s + row * readout_s;
  }
};

/// Tag sizes relative to the configured ones.
struct PrintSizes {
  struct Watched {
    int tag_id{-1};  ///< -1: free
    double scale{};  ///< Beyond `common`.
  };
  double common{};
  std::array<Watched, layout::kWatchedPrints> watched;

  /// Index in `watched`, or -1.
  [[nodiscard]] int find(int tag_id) const;
  /// Factor of the configured size.
  [[nodiscard]] double factor(int tag_id) const;
};

/// Progress of the test of one calibration parameter (CalibrationMonitor).
struct ParameterTest {
  bool is_open{false};
  int images_beyond{0};  ///< Consecutive.
  int opened_with{0};    ///< The same number for parameters that were opened together.
  double score{};        ///< At the last test, in sigmas.
};

/// A tag in the state, fixed in W.
struct WorldTag : TagRecord {
  Pose X_WT;
  /// Pose and covariance are the map's: used and correlated, but not corrected (consider state,
  /// Schmidt 1966).
  bool held{false};
  /// Change of its place that transport_covariance() has left for later.
  Eigen::Vector3d not_transported{Eigen::Vector3d::Zero()};
};

/// Copy of a camera's pose at an image, for tracked points. It has a world-side error, like a tag.
struct Clone {
  Pose X_WV;
  int camera{};
  long image{-1};  ///< Number of the image in ImageMemory; -1: unused.
};

/// A body at one instant, and the errors of its IMU.
struct MovingBody {
  Instant time{};
  Pose X_WB;
  Eigen::Vector3d v_WB{Eigen::Vector3d::Zero()};
  Eigen::Vector3d bias_f{Eigen::Vector3d::Zero()};
  Eigen::Vector3d bias_w{Eigen::Vector3d::Zero()};
  double gravity_offset_m_s2{};  ///< Gravity minus the configured value.
  ImuIntrinsics imu;
  /// Present motion from the last integration step; not estimated.
  Eigen::Vector3d gyro_B{Eigen::Vector3d::Zero()};  ///< Scale and rotation corrected, bias not.
  Eigen::Vector3d a_WB{Eigen::Vector3d::Zero()};

  /// The body some milliseconds later or earlier, at the present motion.
  [[nodiscard]] Pose X_WB_after(double seconds) const;
};

/// Body, biases, extrinsics, clocks, gravity (with an IMU along −z), clones, tags, all in W.
struct FilterMean : MovingBody {
  std::vector<Pose> X_BV;           ///< One per camera.
  std::vector<CameraClock> clocks;  ///< One per camera.
  std::vector<LensOffset> lenses;   ///< One per camera.
  PrintSizes sizes;
  std::vector<ParameterTest> parameter_tests;  ///< Per parameter; empty: none are tested.
  double gyro_drift_sigma{};                   ///< Stationary 1-sigma of imu.gyro_drift, rad/s².
  std::vector<Clone> clones;                   ///< Fixed number, no order; none: no points.
  std::vector<WorldTag> tags;                  ///< Order of entry.
};

/// The state with its covariance.
struct FilterState : FilterMean {
  GrowingCovariance covariance;

  [[nodiscard]] int cameras() const { return static_cast<int>(X_BV.size()); }
  [[nodiscard]] int size() const { return tag_at(tags.size()); }
  [[nodiscard]] Pose X_WV(int camera) const {
    return X_WB * X_BV[static_cast<std::size_t>(camera)];
  }
  [[nodiscard]] int tag_at(std::size_t i) const {
    return layout::tag(cameras(), static_cast<int>(clones.size() + i));
  }
  [[nodiscard]] int clone_at(std::size_t i) const {
    return layout::tag(cameras(), static_cast<int>(i));
  }
  /// size() × size(), symmetric.
  [[nodiscard]] auto P() { return covariance.live(); }
  [[nodiscard]] auto P() const { return covariance.live(); }
  /// Whether shift or readout of a camera's clock is estimated.
  [[nodiscard]] bool clock_is_open(int camera) const {
    return P().diagonal().segment<2>(layout::clock(camera)).maxCoeff() > 0;
  }
  /// Index of a tag in `tags`, or -1.
  [[nodiscard]] int find(int tag_id) const { return find_tag(tags, tag_id); }
  /// Whether calibration parameters are in the state.
  [[nodiscard]] bool has_tested_parameters() const { return !parameter_tests.empty(); }
  /// Column of the tag's own size, or -1.
  [[nodiscard]] int print_at(int tag_id) const {
    const int watched = sizes.find(tag_id);
    return watched < 0 ? -1 : layout::print(cameras(), watched);
  }
  /// Sets the variance of a column, uncorrelated with the rest.
  void clear_column(int at, double sigma);
  /// First columns of blocks of six that are used and not corrected: held tags …
  [[nodiscard]] std::span<const int> held_tags() const { return held_; }
  /// … and others, until release_blocks() or a change of tags.
  void hold_block(int at) { held_.push_back(at); }
  void release_blocks() { list_held(); }

  /// Body at the origin, biases, clocks and covariance zero, no tags.
  void reset(std::vector<Pose> X_BV, std::size_t clones = 0);
  /// Marks the clones as unused.
  void forget_clones();
  /// Appends a tag, uncorrelated with the rest.
  void add_tag(const WorldTag& tag, const Matrix6d& own);
  /// Marginalises tags. @param numbers  ascending
  void remove_tags(std::span<const std::size_t> numbers);
  void remove_tag(std::size_t i) { remove_tags({&i, 1}); }
  /// Makes a tag the map's, at its pose; does not change the covariance.
  void hand_over(std::size_t i, const Pose& X_WT);
  /// Copies all but the covariance.
  void copy_mean(const FilterState& other) {
    static_cast<FilterMean&>(*this) = other;
    held_ = other.held_;
  }
  /// x ⊞ ξ, with ξ of length size() as in `layout`.
  void add_error(const Eigen::Ref<const Eigen::VectorXd>& error);
  /// The error ξ to another mean with the same tags: other = this ⊞ ξ.
  [[nodiscard]] Eigen::VectorXd error_to(const FilterState& other) const;

 private:
  void list_held();
  std::vector<int> held_;
  std::vector<int> columns_;  ///< Scratch of remove_tags().
};

/// Replaces the error of X_WV in the camera blocks by that of X_BV = Exp(e) X̂_BV, which is constant
/// while the body moves.
void camera_errors_to_extrinsics(FilterState& state);
/// The inverse, with the body at its present pose.
void extrinsics_to_camera_errors(FilterState& state);

/// Pose, velocity and biases with their covariance.
[[nodiscard]] BodyEstimate body_in_workspace(const FilterState& state);
/// Transports the covariance after an update with an image of `camera` has moved the mean by
/// `correction` (add_error).
///
/// Earlier images constrain ρ_T − ρ_V + (φ_T − φ_V) × p_T, the place of a tag relative to the
/// camera. Corrections change p_T, above all along the line of sight of a new tag. With ρ_T
/// unchanged the tilt (φ_T − φ_V) would seem observed by the difference, so ρ_T is adapted; body
/// and other cameras likewise. (The point form of the right-invariant error needs no transport, but
/// its IMU steps change every tag.)
void transport_covariance(FilterState& state, const Eigen::Ref<const Eigen::VectorXd>& correction,
                          int camera);

/// Position (additive) and rotation vector of X_BV, both in B axes.
[[nodiscard]] Matrix6d extrinsics_covariance(const FilterState& state, int camera);
/// A tag with its covariance.
[[nodiscard]] KnownTag tag_in_workspace(const FilterState& state, std::size_t tag);

}  // namespace fiducap::world
