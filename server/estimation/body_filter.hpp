#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/gravity.hpp"
#include "capture/imu_sample.hpp"
#include "capture/lens/camera_model.hpp"
#include "detection/tag_observation.hpp"
#include "estimation/body_estimate.hpp"
#include "estimation/estimator_config.hpp"
#include "estimation/found_mismatch.hpp"
#include "estimation/known_tag.hpp"

namespace fiducap {

class BodyFilter;
class CornerNoise;

/// Sensors of the body that a filter tracks.
struct BodySensors {
  std::vector<CameraMount> cameras;
  std::optional<ImuNoise> imu;  ///< nullopt: no IMU, motion by white noise acceleration.
  double gravity_m_s2{kUsualGravity_m_s2};
  /// Initial clock shift of each camera beyond `time_shift`, from an earlier session. May be empty.
  std::vector<double> start_shifts_s{};
  double gravity_sigma_m_s2{kUsualGravitySigma_m_s2};

  void set_known_gravity(double m_s2) {
    gravity_m_s2 = m_s2;
    gravity_sigma_m_s2 = kGivenGravitySigma_m_s2;
  }
  [[nodiscard]] bool is_gravity_known() const {
    return gravity_sigma_m_s2 < kUsualGravitySigma_m_s2;
  }
};

/// Estimated clock of a camera relative to the IMU's.
struct ClockEstimate {
  double shift_s{};        ///< t_imu = stamp + shift, beyond the configured shift.
  double shift_sigma_s{};  ///< 0: not estimated.
  double readout_s{};      ///< Rolling shutter, first row to last.
  double readout_sigma_s{};
};

/// Shift to add to the stamps of a camera's images, given the one applied so far. Shifts below a
/// millisecond or below their sigma are not applied to stamps (synchronised cameras keep theirs);
/// the filter compensates them.
[[nodiscard]] Duration shift_to_apply(const ClockEstimate& clock, Duration applied);

/// Estimated extrinsics, clock and lens of a camera.
struct ExtrinsicsEstimate {
  Pose X_BV;
  /// Position (B axes), attitude (rotation vector in B axes).
  Matrix6d covariance{Matrix6d::Zero()};
  ClockEstimate clock{};
  LensEstimate lens{};
};

/// Noise of the sensors as learned by a filter.
struct LearnedSensors {
  const CornerNoise* corners{};  ///< Owned by the filter; nullptr: as configured.
  double imu_variance{1};        ///< Factor of the configured variances.
  double jitter_s{0};            ///< Independent error of each image's stamp, 1-sigma.
};

/// Records inputs and results of a filter. An interface, so that also trial filters of a start
/// search can be recorded.
class FilterObserver {
 public:
  virtual ~FilterObserver() = default;

  virtual void add(const ImuSample& imu) = 0;
  /// After the filter has processed the image.
  /// @param beliefs  the tags in the filter's state
  /// @param known    the map's knowledge of the image's tags
  virtual void add(const TagObservations& seen, BodyFilter& filter, const UpdateReport& report,
                   std::span<const TagBelief> beliefs, std::span<const KnownTag> known) = 0;
  /// @return another observer with the same settings and no data
  [[nodiscard]] virtual std::unique_ptr<FilterObserver> make_new() const = 0;
};

/// The filter of one rigid body. An interface because two implementations are compared:
/// `robocentric` (the paper's, rcars/) and `world` (production).
///
/// Samples come in the order of SampleMerger: an image exposed at t right after the first IMU
/// sample at or after t.
class BodyFilter {
 public:
  virtual ~BodyFilter() = default;

  /// Stores an IMU sample until the next image: the state is always at the time of an image.
  virtual void propagate(const ImuSample& imu) = 0;

  /// Propagates the state to `seen.exposed_at` and corrects it with the corners.
  /// @param seen  tags of one image; may be empty (the state is propagated all the same)
  /// @param map   knowledge of these tags. Ignored for tags in the filter's own state, which
  ///              contains it already.
  virtual UpdateReport update(const TagObservations& seen, const MapKnowledge& map) = 0;

  /// Surveyed poses of tags that are nevertheless estimated (RECORDING tags.yaml `known_tags`):
  /// fused as a measurement of X_WT when the tag enters the state.
  virtual void set_tag_priors(std::vector<KnownTag> priors) = 0;

  /// The body was lost: no estimate until a tag is seen again. Tags in the state, extrinsics and
  /// biases stay.
  virtual void lose_motion() = 0;

  /// The camera's clock has jumped: `shift_s` is to be added to its stamps from now on, beyond the
  /// configured shift. The body is relocalised.
  virtual void note_clock_jump(int /*camera*/, double /*shift_s*/, double /*sigma_s*/) {
    lose_motion();
  }

  [[nodiscard]] virtual bool running() const = 0;
  /// @pre running()
  [[nodiscard]] virtual BodyEstimate estimate() const = 0;
  /// Replaces `out` by the tags in the state, each with the axes in which it is known.
  virtual void tag_beliefs(std::vector<TagBelief>& out) const = 0;
  /// The same, also while the start may be replaced.
  virtual void own_tags(std::vector<TagBelief>& out) const { tag_beliefs(out); }
  /// Trial filters of a start search are each recorded by a copy of `prototype`.
  virtual void observe_starts(std::unique_ptr<FilterObserver> /*prototype*/) {}
  /// Once after `start_changed`: the record of the selected start, up to the present image.
  [[nodiscard]] virtual std::unique_ptr<FilterObserver> take_start() { return nullptr; }
  [[nodiscard]] virtual std::vector<ExtrinsicsEstimate> extrinsics() const = 0;
  /// The sample merger adds shift_to_apply() to the camera's stamps (SampleMerger::set_clock_shift)
  /// and reports it in TagObservations::clock_shift; the filter compensates the rest.
  [[nodiscard]] virtual ClockEstimate clock(int camera) const = 0;
  /// Noise of one camera and of the IMU.
  [[nodiscard]] virtual LearnedSensors learned(int /*camera*/) const { return {}; }
  /// Replaces `out` by the differences from the configuration that the estimate accounts for.
  virtual void mismatches(std::vector<FoundMismatch>& out) const { out.clear(); }
};

/// Why this filter cannot track a body with these sensors; nullopt: it can.
[[nodiscard]] std::optional<std::string> fault_of_filter(const std::string& name,
                                                         const BodySensors& sensors);

/// @param name  `robocentric` or `world`
/// @pre fault_of_filter() finds none
[[nodiscard]] std::unique_ptr<BodyFilter> make_body_filter(const std::string& name,
                                                           const BodySensors& sensors,
                                                           const WorkspaceGauge& gauge,
                                                           const EstimatorConfig& config);

}  // namespace fiducap
