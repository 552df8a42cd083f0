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
#include "estimation/filter_witness.hpp"
#include "estimation/found_mismatch.hpp"
#include "estimation/known_tag.hpp"
#include "estimation/lens_estimate.hpp"
#include "estimation/tag_belief.hpp"

namespace fiducap {

/// What the filter must know about the body it follows.
struct BodySensors {
  std::vector<CameraMount> cameras;
  std::optional<ImuNoise> imu;  ///< nullopt: no IMU, motion by white noise acceleration.
  double gravity_m_s2{kUsualGravity_m_s2};
  /// What an earlier session learned about each camera's clock, beyond `time_shift`: where the
  /// estimate starts. May be empty.
  std::vector<double> start_shifts_s{};
  double gravity_sigma_m_s2{kUsualGravitySigma_m_s2};

  void tell_gravity(double m_s2) {
    gravity_m_s2 = m_s2;
    gravity_sigma_m_s2 = kToldGravitySigma_m_s2;
  }
  [[nodiscard]] bool is_gravity_told() const {
    return gravity_sigma_m_s2 < kUsualGravitySigma_m_s2;
  }
};

/// The camera's clock against the IMU's, as the filter sees it now.
struct ClockEstimate {
  double shift_s{};        ///< t_imu = stamp + shift, beyond what the configuration says.
  double shift_sigma_s{};  ///< 0: not estimated.
  double readout_s{};      ///< Rolling shutter, first row to last.
  double readout_sigma_s{};
};

/// What to add to the stamps of a camera's images, given what was added so far. Synchronized
/// cameras keep their very stamps: less than a millisecond, or less than is certain, is left to the
/// filter to bridge.
[[nodiscard]] Duration shift_to_apply(const ClockEstimate& clock, Duration applied);

/// The extrinsics as the filter sees them now.
struct ExtrinsicsEstimate {
  Pose X_BV;
  Matrix6d covariance{
      Matrix6d::Zero()};  ///< Position (B axes), attitude (rotation vector in B axes).
  ClockEstimate clock{};
  LensEstimate lens{};
};

class CornerNoise;

/// How noisy sensors are, by what a filter has learned.
struct LearnedSensors {
  const CornerNoise* corners{};  ///< The filter's own; nullptr: as configured.
  double imu_variance{1};        ///< So many times that of the declared densities.
  double jitter_s{0};            ///< 1-sigma by which each image's stamp is off on its own.
};

/// The filter of one rigid body. Two implementations stand side by side and are measured against
/// each other
/// (`robocentric`: the paper's; `world`: production), therefore the interface.
///
/// Samples come in the order of SampleMerger: an image exposed at t right after the first IMU
/// sample at or after t.
class BodyFilter {
 public:
  virtual ~BodyFilter() = default;

  /// Takes one IMU reading. It is kept until the next image moves the state over it: the state
  /// always stands at an image.
  virtual void propagate(const ImuSample& imu) = 0;

  /// Moves the state to `seen.exposed_at` and corrects it with the corners.
  /// @param seen  tags of one image; may be empty (the state is moved all the same)
  /// @param map   what the map knows of them. A tag that is in the filter's own state stays there:
  ///              its knowledge is already in.
  virtual UpdateReport update(const TagObservations& seen, const MapKnowledge& map) = 0;

  /// Survey knowledge of tags that are nevertheless estimated (RECORDING tags.yaml `known_tags`):
  /// when such a tag enters the state, its prior is fused as a measurement of X_WT.
  virtual void set_tag_priors(std::vector<KnownTag> priors) = 0;

  /// The motion is unknown from here on (body was lost): no estimate until a tag is seen again.
  /// Tags in the state, extrinsics and biases stay.
  virtual void lose_motion() = 0;

  /// The camera's clock has jumped: so much is to be added to its stamps from now on, beyond what
  /// is configured. The body is found anew in what was learned.
  virtual void note_clock_jump(int /*camera*/, Duration /*shift*/) { lose_motion(); }

  /// The map has this tag and keeps it: the filter may forget it, and gets it back as a known one
  /// when it is seen again. Nothing happens to the tag that defines the workspace, nor while the
  /// filter is not anchored.
  virtual void release_tag(int tag_id) = 0;

  [[nodiscard]] virtual bool running() const = 0;
  /// @pre running()
  [[nodiscard]] virtual BodyEstimate estimate() const = 0;
  /// Replaces `out` by the tags in the state, each with the axes that it is known in.
  virtual void tag_beliefs(std::vector<TagBelief>& out) const = 0;
  /// The same, also of a start that may be taken back.
  virtual void own_tags(std::vector<TagBelief>& out) const { tag_beliefs(out); }
  /// Starts that are followed again are noted down, each by one like this.
  virtual void witness_starts(std::unique_ptr<FilterWitness> /*afresh*/) {}
  /// After `start_changed`, once: who has noted down the start that has won, up to the present
  /// image.
  [[nodiscard]] virtual std::unique_ptr<FilterWitness> take_start() { return nullptr; }
  [[nodiscard]] virtual std::vector<ExtrinsicsEstimate> extrinsics() const = 0;
  /// The merger of the samples adds shift_to_apply() to the camera's stamps
  /// (SampleMerger::set_clock_shift) and says so in TagObservations::clock_shift; the filter
  /// bridges what is left.
  [[nodiscard]] virtual ClockEstimate clock(int camera) const = 0;
  /// Of one camera, and of the IMU.
  [[nodiscard]] virtual LearnedSensors learned(int /*camera*/) const { return {}; }
  /// Replaces `out` by what was found to be other than the configuration says. The estimate
  /// reckons with it.
  virtual void mismatches(std::vector<FoundMismatch>& out) const { out.clear(); }
};

/// @param name  `robocentric` or `world`
[[nodiscard]] std::unique_ptr<BodyFilter> make_body_filter(const std::string& name,
                                                           const BodySensors& sensors,
                                                           const WorkspaceGauge& gauge,
                                                           const EstimatorConfig& config);

}  // namespace fiducap
